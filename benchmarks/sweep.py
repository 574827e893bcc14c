"""Where reachability ends the tracking, and where control does: ``python benchmarks/sweep.py``.

The skydiver follows sines of every amplitude and frequency of a grid, with one setting of the UTC at a time. At its
zero crossings a sine asks for the yaw acceleration 2 pi frequency x amplitude. A turn is out of reach, marked by a
star, where pattern at its bound and damping at its least give less than that over the next 84 ms, from the state
in which the skydiver then is.
"""

from pathlib import Path

import click
import numpy as np

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.build import build_plant
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.flight import Flight

SCENARIO = "fast_turn_unknown_dynamics"
AMPLITUDES = (100, 200, 300, 400)
FREQUENCIES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
BEYOND: dict[str, object] = {
    "controller.k_hyst_s": 0.7,
    "controller.full_coupling_acceleration": 6.1,
    "controller.aim": "tangent",
}
SETTINGS: dict[str, dict[str, object]] = {"the paper's setting": {}, "beyond the paper, one setting": BEYOND}


def reach(flight: Flight) -> float:
    """Smallest yaw acceleration within reach at the zero crossings after 2 s, over the one asked for."""
    scenario = flight.scenario
    plant = build_plant(load_scenario(SCENARIO, {"plant.limbs.reaction": False}))
    limits, steps, shares = scenario.plant.limits, 20, [np.inf]
    for k in range(round(2.0 / scenario.dt_s), len(flight.reference) - steps):
        if flight.reference[k - 1] * flight.reference[k] > 0.0:
            continue
        asked = flight.reference[k + steps] - flight.reference[k]
        full = np.array([limits.Cm_damp_yaw[0], 0.0, 0.0, limits.alpha[1 if asked > 0 else 0]])
        state = flight.states[k]
        for _ in range(steps):
            state = plant.step(state, full, full)
        shares.append((state[12] - flight.yaw_rate[k]) / asked)
    return float(min(shares))


def sweep(setting: dict[str, object]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """RMSE after 2 s [deg/s], convergence time [s, inf for never] and reach, one row per amplitude."""
    rmse, converged, within = (np.empty((len(AMPLITUDES), len(FREQUENCIES))) for _ in range(3))
    for i, amplitude in enumerate(AMPLITUDES):
        for j, frequency in enumerate(FREQUENCIES):
            turn = {"reference.amplitude_deg_s": float(amplitude), "reference.frequency_hz": frequency}
            flight = simulate(load_scenario(SCENARIO, setting | turn))
            values = metrics(flight)
            since = values["convergence_time_s"]
            rmse[i, j], converged[i, j] = values["rmse_deg_s"], np.inf if since is None else since
            within[i, j] = reach(flight)
    return rmse, converged, within


def shown(value: float) -> str:
    """Two digits at least, and no exponent."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def draw(path: Path, tables: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """One map of the RMSE per setting; turns out of reach carry a star."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.colors import LogNorm

    figure, axes = pyplot.subplots(1, len(tables), figsize=(9, 3.4), sharey=True, layout="constrained")
    for axis, (name, (rmse, within)) in zip(axes, tables.items(), strict=True):
        image = axis.pcolormesh(
            FREQUENCIES, AMPLITUDES, rmse, norm=LogNorm(0.3, 300), cmap="viridis_r", shading="nearest"
        )
        for i, amplitude in enumerate(AMPLITUDES):
            for j, frequency in enumerate(FREQUENCIES):
                text = shown(rmse[i, j]) + ("*" if within[i, j] < 1.0 else "")
                shade = "white" if rmse[i, j] > 10 else "black"
                axis.text(frequency, amplitude, text, ha="center", va="center", color=shade, size=8)
        axis.set(title=name, xlabel="frequency [Hz]", yticks=AMPLITUDES)
    axes[0].set_ylabel("amplitude [deg/s]")
    figure.colorbar(image, ax=axes, label="RMSE after 2 s [deg/s]")
    figure.savefig(path, dpi=110)


@click.command(help=__doc__)
@click.option("--figure", type=click.Path(path_type=Path), help="Write the maps of the RMSE here.")
def main(figure: Path | None) -> None:
    """Print one table per setting, and draw them."""
    tables = {}
    for name, setting in SETTINGS.items():
        rmse, converged, within = sweep(setting)
        tables[name] = (rmse, within)
        print(f"\n{name}: RMSE after 2 s [deg/s] (converged after [s]; * out of reach)\n")
        print("| amplitude | " + " | ".join(f"{frequency:g} Hz" for frequency in FREQUENCIES) + " |")
        print("|---" * (len(FREQUENCIES) + 1) + "|")
        for i, amplitude in enumerate(AMPLITUDES):
            cells = [
                f"{shown(rmse[i, j])} ({converged[i, j]:.1f})" + ("*" if within[i, j] < 1.0 else "")
                for j in range(len(FREQUENCIES))
            ]
            print(f"| {amplitude} | " + " | ".join(cells) + " |")
    if figure is not None:
        draw(figure, tables)


if __name__ == "__main__":
    main()
