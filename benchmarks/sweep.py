"""How far one setting of UTC follows, and how far the body can: ``python benchmarks/sweep.py``.

The skydiver follows sines of every amplitude and frequency of a grid, with one setting of a controller at a time:
UTC as the paper has it, UTC with the options beyond the paper, and Gauss-Newton predictive control with one held
control, which has UTC's parametrisation. What one of them follows, the body can do; what all lose, it may still do.
"""

from pathlib import Path

import click
import numpy as np

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.closed_loop import simulate

AMPLITUDES = (100, 200, 300, 400)
FREQUENCIES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
FLOWN = {
    "UTC, the paper's setting": "fast_turn_unknown_dynamics",
    "UTC, beyond the paper": "fast_turn_beyond_the_paper",
    "Gauss-Newton, one held control": "fast_turn_gauss_newton_held",
}


def turn_of(amplitude: float, frequency: float) -> dict[str, float | int]:
    """One turn of the grid, as changes to a scenario."""
    return {"reference.amplitude_deg_s": float(amplitude), "reference.frequency_hz": frequency}


def sweep(scenario: str) -> tuple[np.ndarray, np.ndarray]:
    """RMSE after 2 s [deg/s] and convergence time [s, inf for never], one row per amplitude."""
    rmse, converged = (np.empty((len(AMPLITUDES), len(FREQUENCIES))) for _ in range(2))
    for i, amplitude in enumerate(AMPLITUDES):
        for j, frequency in enumerate(FREQUENCIES):
            values = metrics(simulate(load_scenario(scenario, turn_of(amplitude, frequency))))
            since = values["convergence_time_s"]
            rmse[i, j], converged[i, j] = values["rmse_deg_s"], np.inf if since is None else since
    return rmse, converged


def shown(value: float) -> str:
    """Two digits at least, and no exponent."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def draw(path: Path, maps: dict[str, np.ndarray]) -> None:
    """One map of the RMSE per setting."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.colors import LogNorm

    figure, axes = pyplot.subplots(1, len(maps), figsize=(12, 3.4), sharey=True, layout="constrained")
    for axis, (name, rmse) in zip(axes, maps.items(), strict=True):
        image = axis.pcolormesh(
            FREQUENCIES, AMPLITUDES, rmse, norm=LogNorm(0.02, 300), cmap="viridis_r", shading="nearest"
        )
        for i, amplitude in enumerate(AMPLITUDES):
            for j, frequency in enumerate(FREQUENCIES):
                shade = "white" if rmse[i, j] > 10 else "black"
                axis.text(
                    frequency, amplitude, shown(rmse[i, j]), ha="center", va="center", color=shade, size=8
                )
        axis.set(title=name, xlabel="frequency [Hz]", yticks=AMPLITUDES)
    axes[0].set_ylabel("amplitude [deg/s]")
    figure.colorbar(image, ax=axes, label="RMSE after 2 s [deg/s]")
    figure.savefig(path, dpi=110)


@click.command(help=__doc__)
@click.option("--figure", type=click.Path(path_type=Path), help="Write the maps of the RMSE here.")
def main(figure: Path | None) -> None:
    """Print one table per setting, and draw them."""
    maps = {}
    for name, scenario in FLOWN.items():
        maps[name], converged = sweep(scenario)
        print(f"\n{name}: RMSE after 2 s [deg/s] (converged after [s])\n")
        print("| amplitude | " + " | ".join(f"{frequency:g} Hz" for frequency in FREQUENCIES) + " |")
        print("|---" * (len(FREQUENCIES) + 1) + "|")
        for amplitude, row, times in zip(AMPLITUDES, maps[name], converged, strict=True):
            cells = [f"{shown(value)} ({time:.1f})" for value, time in zip(row, times, strict=True)]
            print(f"| {amplitude} | " + " | ".join(cells) + " |", flush=True)
    if figure is not None:
        draw(figure, maps)


if __name__ == "__main__":
    main()
