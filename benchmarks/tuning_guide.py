# SPDX-License-Identifier: Apache-2.0
"""The figures of docs/tuning-skydiver.md: right and wrong settings of the athlete for each step beside each other.

``python benchmarks/tuning_guide.py docs/figures/tuning``
"""

from pathlib import Path
from typing import NamedTuple

import click
from telemetry_figure import telemetry_figure

from skydiver_utc.analysis.style import png
from skydiver_utc.loop.run import Run
from skydiver_utc.studies.cases import Case, case, run_all
from skydiver_utc.studies.paper_cases import PI, UNKNOWN

# The paper's hand force in the other direction: the hands bank the athlete and slow his fall.
STRONG_HANDS = (("plant.hands.force", "dorsal"), ("plant.hands.K_N", 100.0))
ROLL_RATE = ("controller.outputs.roll_rate", {"reference": 0.0, "P_err": 1e-4})
FALL_RATE = ("controller.outputs.fall_rate", {"reference": 57.2, "P_err": 0.05})


class Step(NamedTuple):
    """One step of the recipe: cases side by side, each with the meaning of its settings."""

    name: str
    title: str
    cases: dict[str, Case]


def _athlete(scenario: str, *settings: tuple[str, object]) -> Case:
    return case(scenario, ("plant.skydiver", "athlete"), *settings)


def _nominal(damping: float, hands: float) -> tuple[str, object]:
    return (
        "controller.nominal",
        {
            "Cm_damp_yaw": {"value": 0.3, "variance": damping},
            "k_right": {"value": 0.0, "variance": hands},
            "k_left": {"value": 0.0, "variance": hands},
        },
    )


STEPS = (
    Step(
        "1_weight",
        "W0: how far the sigma points reach",
        {
            "W0 = -1: close": _athlete(PI, ("controller.W0", -1.0)),
            "W0 = 0.25": _athlete(PI),
            "W0 = 0.9: far": _athlete(PI, ("controller.W0", 0.9)),
        },
    ),
    Step(
        "2_error",
        "P_err: how accurately to track",
        {
            "P_err = 1e-6": _athlete(UNKNOWN, ("controller.P_err", 1e-6)),
            "P_err = 1e-4": _athlete(UNKNOWN),
            "P_err = 1: hardly tracks": _athlete(UNKNOWN, ("controller.P_err", 1.0)),
        },
    ),
    Step(
        "3_covariance",
        "Variances and coupling: which controls move, and which together",
        {
            "damping variance / 100": _athlete(UNKNOWN, ("controller.Pu.Cm_damp_yaw", 0.0625)),
            "as it is": _athlete(UNKNOWN),
            "no covariances at all": _athlete(
                UNKNOWN, ("controller.coupling.signs", "none"), ("controller.coupling.alpha", 0.0)
            ),
        },
    ),
    Step(
        "4_noise",
        "Qu: how much the spread of the sigma points grows in each step",
        {
            "Qu = 0.001 Pu": _athlete(UNKNOWN, ("controller.Qu_ratio", 0.001)),
            "Qu = 0.1 Pu": _athlete(UNKNOWN),
            "Qu = 3 Pu": _athlete(UNKNOWN, ("controller.Qu_ratio", 3.0)),
        },
    ),
    Step(
        "5_horizon",
        "Horizon: long enough to tell controls apart, short against the turn",
        {
            "N = 5": _athlete(UNKNOWN, ("controller.horizon_steps", 5)),
            "N = 20": _athlete(UNKNOWN),
            "N = 60": _athlete(UNKNOWN, ("controller.horizon_steps", 60)),
        },
    ),
    Step(
        "6_dynamics",
        "Dynamics of alpha inside the horizon",
        {
            "held, N = 5": _athlete(UNKNOWN, ("controller.horizon_steps", 5)),
            "proportional, N = 5": _athlete(PI),
        },
    ),
    Step(
        "7_outputs",
        "Outputs: what else must not move",
        {
            "yaw rate alone, strong hands": _athlete(PI, *STRONG_HANDS),
            "and roll rate": _athlete(PI, *STRONG_HANDS, ROLL_RATE),
            "and roll and fall rate": _athlete(PI, *STRONG_HANDS, ROLL_RATE, FALL_RATE),
        },
    ),
    Step(
        "8_rest",
        "Nominal control: the controls that the outputs leave free",
        {
            "none": _athlete(UNKNOWN),
            "with nominal values": _athlete(UNKNOWN, _nominal(damping=0.05, hands=1.0)),
            "variances / 100: too tight": _athlete(UNKNOWN, _nominal(damping=0.0005, hands=0.01)),
        },
    ),
)  # fmt: skip


def whole(run: Run) -> Run:
    """Keep the run itself."""
    return run


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--workers", default=2, show_default=True)
def main(folder: Path, workers: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    cases = {one.command: one.load() for step in STEPS for one in step.cases.values()}
    runs = run_all(cases, whole, workers, lambda done: print(f"{done} of {len(cases)} runs", flush=True))
    for step in STEPS:
        shown = {label: runs[one.command] for label, one in step.cases.items()}
        (folder / f"{step.name}.png").write_bytes(png(telemetry_figure(step.title, shown)))


if __name__ == "__main__":
    main()
