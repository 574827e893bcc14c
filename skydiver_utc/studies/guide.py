"""The flights that the tuning guide shows: for each step of the recipe what is right, and what wrong looks like."""

from typing import NamedTuple

from skydiver_utc.simulation.flight import Flight
from skydiver_utc.studies.paper_runs import PI, PRINTED_HANDS, UNKNOWN
from skydiver_utc.studies.runs import Done, Run, fly_all, run, whole


class Step(NamedTuple):
    """One step of the recipe: the flights side by side, each under what its settings mean."""

    name: str
    title: str
    flights: dict[str, Run]


def _rest(damping: float, hands: float) -> tuple[tuple[str, float], ...]:
    return (
        ("controller.rest_Cm_damp_yaw", 0.3),
        ("controller.P_rest_Cm_damp_yaw", damping),
        ("controller.P_rest_hands", hands),
    )


STEPS = (
    Step(
        "1_weight",
        "W0: how far the sigma points reach",
        {
            "W0 = -1: close": run(PI, ("controller.W0", -1.0)),
            "W0 = 0.25": run(PI),
            "W0 = 0.9: far": run(PI, ("controller.W0", 0.9)),
        },
    ),
    Step(
        "2_error",
        "P_err: how accurately to track",
        {
            "P_err = 1e-6": run(UNKNOWN, ("controller.P_err", 1e-6)),
            "P_err = 1e-4": run(UNKNOWN),
            "P_err = 1: lazy": run(UNKNOWN, ("controller.P_err", 1.0)),
        },
    ),
    Step(
        "3_covariance",
        "Variances and coupling: who moves, and who moves with whom",
        {
            "damping variance / 100": run(UNKNOWN, ("controller.variance_Cm_damp_yaw", 0.0625)),
            "as it is": run(UNKNOWN),
            "no covariances at all": run(
                UNKNOWN, ("controller.coupling", "none"), ("controller.covariance_14", 0.0)
            ),
        },
    ),
    Step(
        "4_noise",
        "Qu: how fast the spread comes back",
        {
            "Qu = 0.001 Pu": run(UNKNOWN, ("controller.Qu_ratio", 0.001)),
            "Qu = 0.1 Pu": run(UNKNOWN),
            "Qu = 3 Pu": run(UNKNOWN, ("controller.Qu_ratio", 3.0)),
        },
    ),
    Step(
        "5_horizon",
        "Horizon: as long as the slowest actuator needs",
        {
            "N = 5": run(UNKNOWN, ("controller.horizon_steps", 5)),
            "N = 20": run(UNKNOWN),
            "N = 60": run(UNKNOWN, ("controller.horizon_steps", 60)),
        },
    ),
    Step(
        "6_dynamics",
        "Dynamics of alpha inside the horizon, and which control is saved",
        {
            "eq:m1utc, positional": run(PI, ("controller.alpha_dynamics", "positional")),
            "eq:m1utc, incremental": run(PI),
            "incremental, saved at the horizon": run(PI, ("controller.saved_control_reading", "horizon")),
        },
    ),
    Step(
        "7_outputs",
        "Outputs: what else must not move",
        {
            "yaw rate alone, strong hands": run(PI, PRINTED_HANDS),
            "and roll rate": run("fast_turn_paper_hands", ("controller.P_err_fall_rate", 0.0)),
            "and roll and fall rate": run("fast_turn_paper_hands"),
        },
    ),
    Step(
        "8_rest",
        "Rest: where controls go that the outputs do not see",
        {
            "not drawn": run(UNKNOWN),
            "drawn to rest": run(UNKNOWN, *_rest(damping=0.05, hands=1.0)),
            "P_rest / 100: too tight": run(UNKNOWN, *_rest(damping=0.0005, hands=0.01)),
        },
    ),
)  # fmt: skip


def fly_guide(jobs: int, done: Done) -> dict[str, Flight]:
    """Every flight of the guide, once, by its command."""
    runs = {one.command: one for step in STEPS for one in step.flights.values()}
    return fly_all({command: one.load() for command, one in runs.items()}, whole, jobs, done)


def flights_in_guide() -> int:
    """How many flights that are."""
    return len({one.command for step in STEPS for one in step.flights.values()})
