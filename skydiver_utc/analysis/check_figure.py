"""The picture of a check: recorded commands under the answers of the controller that was asked again."""

from matplotlib.figure import Figure

from skydiver_utc.analysis.controller_check import Check
from skydiver_utc.analysis.figures import CONTROLS
from skydiver_utc.analysis.style import GREY, empty_figure, house_style


def check_figure(found: Check, asked: str) -> Figure:
    """The four controls over time, recorded and answered; 8 by 6.4 inches. `asked` says whose answers they are."""
    flight = found.flight
    with house_style():
        figure = empty_figure(8.0, 6.4)
        rows = figure.subplots(len(CONTROLS), 1, sharex=True, gridspec_kw={"hspace": 0.19})
        time_s = flight.time_s[:-1]
        for j, (axes, (label, colour)) in enumerate(zip(rows, CONTROLS, strict=True)):
            recorded, answers = flight.commands[:, j], found.commands[:, j]
            axes.step(time_s, recorded, where="post", color="#999999", linewidth=2.4, label="recorded")
            axes.step(time_s, answers, where="post", color=colour, linewidth=1.0, label="asked again")
            axes.set_ylabel(label, fontsize=8.5)
            axes.yaxis.set_label_coords(-0.085, 0.5)
        rows[0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.0)
        rows[-1].set_xlabel("time [s]")
        rows[-1].set_xlim(float(flight.time_s[0]), float(flight.time_s[-1]))
        figure.text(0.02, 0.975, f"What {asked} would have done", fontsize=13, fontweight="bold", va="top")
        text = f"at the states of the recorded flight of {flight.scenario.name}"
        figure.text(0.02, 0.935, text, va="top", color=GREY)
        figure.subplots_adjust(left=0.13, right=0.975, bottom=0.08, top=0.88)
    return figure
