# SPDX-License-Identifier: Apache-2.0
"""How far one setting of UTC follows, and how far the body can: ``python benchmarks/sweep.py``.

The athlete follows sines of every amplitude and frequency of a grid, with one setting of a controller at a time:
UTC as the paper has it, UTC with the options beyond the paper, and Gauss-Newton predictive control with one held
control, which has UTC's parametrisation. What one of them follows, the body can do. Where the body itself is at
its end, whoever controls it, its largest yaw acceleration tells (reachability.py): in the straight fall, and along
each flight of Gauss-Newton.
"""

from pathlib import Path

import click
import numpy as np
import reachability
from skydivers import flown_by

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import load_scenario

AMPLITUDES = (100, 200, 300, 400)
FREQUENCIES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
GAUSS_NEWTON = "Gauss-Newton, one held control"
ASKED = "Asked of the body"
FLOWN = {
    "UTC, the paper's setting": "fast_turn_unknown_dynamics",
    "UTC, beyond the paper": "fast_turn_beyond_the_paper",
    GAUSS_NEWTON: "fast_turn_gauss_newton_held",
}


def turn_of(amplitude: float, frequency: float) -> dict[str, float | int]:
    """One turn of the grid, as changes to a scenario."""
    return {"reference.amplitude_deg_s": float(amplitude), "reference.frequency_hz": frequency}


def sweep(scenario: str) -> list[list[Run]]:
    """Each turn flown, one row per amplitude."""

    def flown(amplitude: float, frequency: float) -> Run:
        return simulate(
            load_scenario(scenario, flown_by("athlete", scenario) | turn_of(amplitude, frequency))
        )

    return [[flown(a, f) for f in FREQUENCIES] for a in AMPLITUDES]


def result(flight: Run) -> tuple[float, float]:
    """RMSE after 2 s [deg/s] and convergence time [s], inf for never."""
    values = metrics(flight)
    since = values["convergence_time_s"]
    return values["rmse_deg_s"], np.inf if since is None else since


def shown(value: float) -> str:
    """Two digits at least, and no exponent."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def draw(path: Path, maps: dict[str, np.ndarray]) -> None:
    """One map of the RMSE per setting, and one of what the turns ask of the body."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.colors import LogNorm, TwoSlopeNorm

    figure, axes = pyplot.subplots(1, len(maps), figsize=(14.5, 3.6), sharey=True, layout="constrained")
    for axis, (name, values) in zip(axes, maps.items(), strict=True):
        asked = name == ASKED
        norm, colours = (
            (TwoSlopeNorm(1.0, 0.0, 1.5), "RdBu_r") if asked else (LogNorm(0.02, 300), "viridis_r")
        )
        image = axis.pcolormesh(FREQUENCIES, AMPLITUDES, values, norm=norm, cmap=colours, shading="nearest")
        dark = values < 0.3 if asked else values > 10
        for (i, j), value in np.ndenumerate(values):
            shade = "white" if dark[i, j] else "black"
            place = (FREQUENCIES[j], AMPLITUDES[i])
            axis.text(*place, shown(value), ha="center", va="center", color=shade, size=8)
        axis.set(title=name, xlabel="frequency [Hz]", yticks=AMPLITUDES)
        if asked:
            figure.colorbar(image, ax=axis, label="share of the largest yaw acceleration")
        else:
            of_rmse = image
    axes[0].set_ylabel("amplitude [deg/s]")
    figure.colorbar(of_rmse, ax=axes[:-1], label="RMSE after 2 s [deg/s]")
    figure.savefig(path, dpi=110)


def tell(title: str, cells: list[list[str]]) -> None:
    """One table, a row per amplitude."""
    print(
        f"\n{title}\n\n| amplitude | " + " | ".join(f"{frequency:g} Hz" for frequency in FREQUENCIES) + " |"
    )
    print("|---" * (len(FREQUENCIES) + 1) + "|")
    for amplitude, row in zip(AMPLITUDES, cells, strict=True):
        print(f"| {amplitude} | " + " | ".join(row) + " |", flush=True)


@click.command(help=__doc__)
@click.option("--figure", type=click.Path(path_type=Path), help="Write the maps of the RMSE here.")
def main(figure: Path | None) -> None:
    """Print one table per setting and two of what is asked of the body, and draw them."""
    maps = {}
    for name, scenario in FLOWN.items():
        flights = sweep(scenario)
        results = [[result(flight) for flight in row] for row in flights]
        maps[name] = np.array(results)[..., 0]
        title = f"{name}: RMSE after 2 s [deg/s] (converged after [s])"
        tell(title, [[f"{shown(rmse)} ({since:.1f})" for rmse, since in row] for row in results])
        if name == GAUSS_NEWTON:
            shares = [[reachability.in_flight(flight) for flight in row] for row in flights]
            title = f"{name}: share of the largest yaw acceleration asked for, at most (above 1 for so long)"
            tell(title, [[f"{largest:.2f} ({above:.0%})" for largest, above in row] for row in shares])
    athlete = load_scenario(FLOWN[GAUSS_NEWTON], flown_by("athlete", FLOWN[GAUSS_NEWTON]))
    maps[ASKED] = reachability.of_sines(athlete, AMPLITUDES, FREQUENCIES)
    tell(
        f"{ASKED}, straight fall: the same share", [[f"{share:.2f}" for share in row] for row in maps[ASKED]]
    )
    if figure is not None:
        draw(figure, maps)


if __name__ == "__main__":
    main()
