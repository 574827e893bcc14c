"""What is flown to compare this package with the paper: configurations, readings, sweeps."""

from typing import NamedTuple

from skydiver_utc.studies.runs import Run, run

UNKNOWN, PI, PI_Q3 = (
    "fast_turn_unknown_dynamics",
    "fast_turn_pi_dynamics",
    "fast_turn_pi_dynamics_rate_coupling",
)
NO_COUPLING = ("controller.coupling", "none")
PRINTED_HANDS = ("plant.hands.K_N", 100.0)
IDLE_HANDS = ("plant.hands.K_N", 0.0)

POSE_FAST, POSE_SLOW = run("fast_turn_pose_only"), run("slow_turn_pose_only")
LQR_FAST, LQR_SLOW = run("fast_turn_lqr"), run("slow_turn_lqr")
M0_C2, M1_C2, M1_C3 = run(UNKNOWN), run(PI), run(PI_Q3)
M0_C3 = run(UNKNOWN, ("controller.coupling", "yaw_acceleration"))
M0_NONE, M1_NONE = run(UNKNOWN, NO_COUPLING), run(PI, NO_COUPLING)
M0_SHORT, M1_LONG = run(UNKNOWN, ("controller.horizon_steps", 5)), run(PI, ("controller.horizon_steps", 20))
POSTURE_ALONE = run(UNKNOWN, IDLE_HANDS, ("plant.limits.Cm_damp_yaw", [0.499, 0.501]))
HANDS_IDLE = (run(UNKNOWN, IDLE_HANDS), run(PI, IDLE_HANDS), run(PI_Q3, IDLE_HANDS))
LAYOUTS = (run("front_layout"), run("back_layout"))
PAPER_HANDS = run("fast_turn_paper_hands")

# The paper's figures of a flight, by their LaTeX labels.
FIGURES = {"ff6": POSE_FAST, "utc_m0_c2": M0_C2, "utc_m1_c2": M1_C2, "utc_m1_c3": M1_C3}

CONFIGURATIONS: dict[str, Run] = {
    "pose controller, fast turn (`ff6`)": POSE_FAST,
    "pose controller, slow turn": POSE_SLOW,
    "linear-quadratic regulator, fast turn": LQR_FAST,
    "linear-quadratic regulator, slow turn": LQR_SLOW,
    "UTC, alpha unknown, eq_q1, N = 20 (`utc_m0_c2`)": M0_C2,
    "UTC, alpha unknown, eq_q3, N = 20": M0_C3,
    "UTC, alpha unknown, no coupling, N = 20": M0_NONE,
    "UTC, alpha unknown, eq_q1, N = 5": M0_SHORT,
    "UTC, eq:m1utc, eq_q1, N = 5 (`utc_m1_c2`)": M1_C2,
    "UTC, eq:m1utc, no coupling, N = 5": M1_NONE,
    "UTC, eq:m1utc, eq_q1, N = 20": M1_LONG,
    "UTC, eq:m1utc, eq_q3, N = 5 (`utc_m1_c3`)": M1_C3,
    "the posture alone, flown by UTC": POSTURE_ALONE,
    "`utc_m0_c2` with hands that have no force": HANDS_IDLE[0],
    "`utc_m1_c2` with hands that have no force": HANDS_IDLE[1],
    "`utc_m1_c3` with hands that have no force": HANDS_IDLE[2],
}


class Reading(NamedTuple):
    """One place where the paper's text leaves a choice or does not work as printed; `flown` is the other choice."""

    point: str
    printed: str
    happens: str
    working: str
    flown: Run | None


READINGS = (
    Reading(
        "Pu at k = 0",
        "variances 6.25, .01, .01, .01 with covariances .74, .74, .56",
        "indefinite, eigenvalue -0.208: no real root, and Qu = 0.1 Pu brings it back every step",
        "symmetrise, lift negative eigenvalues to `covariance_floor` before each root; the amount is published as"
        " `repaired_covariance`",
        run(UNKNOWN, ("controller.covariance_reading", "printed")),
    ),
    Reading(
        "eq:s14, sign",
        "from the change of abs(yr_ref) only",
        "right for left turns, drives alpha the wrong way in right turns",
        "times sign(yr_ref)",
        run(UNKNOWN, ("controller.s14_sign_reading", "printed")),
    ),
    Reading(
        "eq:s14, recursion",
        "s14 flips each step while speeding up, so its hysteresis never takes hold",
        "harmless: without any hysteresis the flight is much the same",
        "as printed",
        run(UNKNOWN, ("controller.s14_recursion_reading", "no_hysteresis")),
    ),
    Reading(
        "the same",
        "the text's look-ahead of 1 s, taken at its word",
        "alpha leads the turn by a second",
        "as printed",
        run(UNKNOWN, ("controller.s14_recursion_reading", "look_ahead")),
    ),
    Reading(
        'eq:xpred, "U^i at the horizon", alpha unknown',
        "the control at the end of the horizon is saved",
        "the slew limit distorts the spread",
        "U^i as drawn and bounded",
        run(UNKNOWN, ("controller.saved_control_reading", "horizon")),
    ),
    Reading(
        "the same with eq:m1utc",
        "the control at the end of the horizon is saved",
        "the increments of the whole horizon are applied in one step: limit cycle at the start",
        "U^i after the first step, which is what acts next",
        run(PI, ("controller.saved_control_reading", "horizon")),
    ),
    Reading(
        "dynamics of alpha",
        "the block diagram is positional",
        "the sigma point's own alpha is thrown away",
        "eq:m1utc, incremental",
        run(PI, ("controller.alpha_dynamics", "positional")),
    ),
    Reading(
        "eq:zpred",
        "W^i = (1 - W0) / 2m for i = 0 as well",
        "the weights of the mean sum to .844",
        "W^0 as in eq:sigp",
        run(UNKNOWN, ("controller.weights_reading", "printed")),
    ),
    Reading(
        "eq:movep",
        'after "bounded"',
        "the rule can never act",
        "on the unclipped point, then bound",
        run(UNKNOWN, ("controller.move_reading", "printed")),
    ),
    Reading("eq:sigp", "sqrt(n / (1 - W0)), n undefined", "", "n = m", None),
    Reading(
        'eq:m1utc, "t - dt" at the start of the horizon',
        "the yaw rate measured one step before",
        "alpha winds away",
        "the yaw rate before the first step counts as unchanged",
        run(PI, ("controller.first_increment_reading", "measured")),
    ),
    Reading(
        "eq_force2",
        "K_N = 100 N",
        "the body rolls over",
        "K_N = 10 N, or further outputs",
        run(UNKNOWN, PRINTED_HANDS),
    ),
)  # fmt: skip

HANDS: tuple[Run, ...] = (
    PAPER_HANDS,
    run("fast_turn_paper_hands", ("controller.P_err_fall_rate", 0.0)),
    run("fast_turn_paper_hands", ("controller.P_err_roll_rate", 0.0)),
    run(
        "fast_turn_paper_hands", ("controller.P_err_roll_rate", 0.0), ("controller.P_err_fall_rate", 0.0)
    ),
    run("fast_turn_paper_hands", ("plant.damping.Cm_damp_roll", 4.0)),
    run("fast_turn_paper_hands", ("plant.damping.Cm_damp_roll", 15.0)),
    run("fast_turn_paper_hands", NO_COUPLING),
    run("fast_turn_paper_hands", ("controller.coupling", "yaw_acceleration")),
    run(
        "fast_turn_paper_hands",
        ("controller.alpha_dynamics", "unknown"),
        ("controller.saved_control_reading", "drawn"),
        ("controller.horizon_steps", 20),
    ),
)  # fmt: skip

LIMB_SETTINGS: tuple[tuple[tuple[str, object], ...], ...] = (
    (),
    (("plant.limbs.reaction", False),),
    (("plant.limbs.alpha_acceleration", 20.0),),
    (("plant.limbs.alpha_acceleration", 1000.0),),
)
LIMBS = {
    (name, settings): run(name, *settings) for settings in LIMB_SETTINGS for name in (UNKNOWN, PI, PI_Q3)
}


class Sweep(NamedTuple):
    """One parameter of UTC over several values, the scenarios' own among them."""

    setting: str
    label: str
    values: tuple[float, ...]
    logarithmic: bool
    ticks: tuple[float, ...]  # none: as the figure likes

    def runs(self, scenario: str) -> list[Run]:
        """The scenario's flights, one for each value."""
        return [run(scenario, (self.setting, value)) for value in self.values]


P_ERR = Sweep(
    "controller.P_err", "$P_{err}$ [(rad/s)$^2$]", (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0), True, ()
)
W0 = Sweep("controller.W0", "$W^0$ [1]", (-3.0, -1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 0.9), False, ())
_STEPS = (2, 3, 5, 7, 10, 14, 20, 30, 40)
HORIZON = Sweep("controller.horizon_steps", "prediction steps $N$", _STEPS, True, (2, 5, 10, 20, 40))
SWEEPS = (P_ERR, W0, HORIZON)
SWEPT = (UNKNOWN, PI)


def all_runs() -> dict[str, Run]:
    """Every flight of the comparison, once, by its command."""
    runs = [
        *FIGURES.values(),
        *CONFIGURATIONS.values(),
        *LAYOUTS,
        *(reading.flown for reading in READINGS if reading.flown is not None),
        *HANDS,
        *LIMBS.values(),
        *(one for sweep in SWEEPS for scenario in SWEPT for one in sweep.runs(scenario)),
    ]
    return {one.command: one for one in runs}
