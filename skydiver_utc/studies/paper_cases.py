# SPDX-License-Identifier: Apache-2.0
"""The runs of the comparison with the paper: configurations, variants of the equations, sweeps."""

from typing import NamedTuple

from skydiver_utc.studies.cases import Case, case
from skydiver_utc.studies.paper_variants import KIND

UNKNOWN, PI, PI_Q3 = (
    "fast_turn_unknown_dynamics",
    "fast_turn_pi_dynamics",
    "fast_turn_pi_dynamics_rate_coupling",
)
NO_COUPLING = ("controller.coupling.signs", "none")
PRINTED_HANDS = ("plant.hands.K_N", 100.0)
IDLE_HANDS = ("plant.hands.K_N", 0.0)
# The largest variance of an output's error: it does not count.
NO_ROLL_RATE = ("controller.outputs.roll_rate.P_err", 1e6)
NO_FALL_RATE = ("controller.outputs.fall_rate.P_err", 1e6)

POSE_FAST, POSE_SLOW = case("fast_turn_pose_only"), case("slow_turn_pose_only")
LQR_FAST, LQR_SLOW = case("fast_turn_lqr"), case("slow_turn_lqr")
M0_C2, M1_C2, M1_C3 = case(UNKNOWN), case(PI), case(PI_Q3)
M0_C3 = case(UNKNOWN, ("controller.coupling.signs", "yaw_acceleration"))
M0_NONE, M1_NONE = case(UNKNOWN, NO_COUPLING), case(PI, NO_COUPLING)
M0_SHORT, M1_LONG = case(UNKNOWN, ("controller.horizon_steps", 5)), case(PI, ("controller.horizon_steps", 20))
POSTURE_ALONE = case(UNKNOWN, IDLE_HANDS, ("plant.limits.Cm_damp_yaw", [0.499, 0.501]))
HANDS_IDLE = (case(UNKNOWN, IDLE_HANDS), case(PI, IDLE_HANDS), case(PI_Q3, IDLE_HANDS))
LAYOUTS = (case("front_layout"), case("back_layout"))
PAPER_HANDS = case("fast_turn_paper_hands")

# The paper's figures of a flight, by their LaTeX labels.
FIGURES = {"ff6": POSE_FAST, "utc_m0_c2": M0_C2, "utc_m1_c2": M1_C2, "utc_m1_c3": M1_C3}

CONFIGURATIONS: dict[str, Case] = {
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


def varied(scenario: str, variant: str) -> Case:
    """The scenario with the paper's law as transcribed, under a variant of its equations."""
    return case(scenario, ("controller.kind", KIND), ("controller.variants", [variant]))


class Variant(NamedTuple):
    """A place where the paper's text is open or does not work as printed; `flown` has the other choice."""

    point: str
    printed: str
    happens: str
    working: str
    flown: Case | None


VARIANTS = (
    Variant(
        "Pu at k = 0",
        "variances 6.25, .01, .01, .01 with covariances .74, .74, .56",
        "indefinite, eigenvalue -0.208: no real root, and Qu = 0.1 Pu brings it back every step",
        "symmetrise, lift negative eigenvalues to `covariance_floor` before each root; the amount is published as"
        " `repaired_covariance`",
        varied(UNKNOWN, "indefinite_covariance"),
    ),
    Variant(
        "eq:s14, sign",
        "from the change of abs(yr_ref) only",
        "right for left turns, drives alpha the wrong way in right turns",
        "times sign(yr_ref)",
        varied(UNKNOWN, "unsigned_s14"),
    ),
    Variant(
        "eq:s14, recursion",
        "s14 flips each step while speeding up, so its hysteresis never takes hold",
        "harmless: without any hysteresis the flight is much the same",
        "as printed",
        varied(UNKNOWN, "no_hysteresis"),
    ),
    Variant(
        "the same",
        "the text's look-ahead of 1 s, taken at its word",
        "alpha leads the turn by a second",
        "as printed",
        varied(UNKNOWN, "always_ahead"),
    ),
    Variant(
        'eq:xpred, "U^i at the horizon", alpha unknown',
        "the control at the end of the horizon is saved",
        "the slew limit distorts the spread",
        "U^i as drawn and bounded",
        varied(UNKNOWN, "saved_at_horizon"),
    ),
    Variant(
        "the same with eq:m1utc",
        "the control at the end of the horizon is saved",
        "the increments of the whole horizon are applied in one step: limit cycle at the start",
        "U^i after the first step, which is what acts next",
        varied(PI, "saved_at_horizon"),
    ),
    Variant(
        "dynamics of alpha",
        "the block diagram is positional",
        "the sigma point's own alpha is thrown away",
        "eq:m1utc, incremental",
        varied(PI, "positional"),
    ),
    Variant(
        "eq:zpred",
        "W^i = (1 - W0) / 2m for i = 0 as well",
        "the weights of the mean sum to .844",
        "W^0 as in eq:sigp",
        varied(UNKNOWN, "printed_weights"),
    ),
    Variant(
        "eq:movep",
        'after "bounded"',
        "the rule can never act",
        "on the unclipped point, then bound",
        varied(UNKNOWN, "moved_after_bounds"),
    ),
    Variant("eq:sigp", "sqrt(n / (1 - W0)), n undefined", "", "n = m", None),
    Variant(
        'eq:m1utc, "t - dt" at the start of the horizon',
        "the yaw rate measured one step before",
        "alpha winds away",
        "the yaw rate before the first step counts as unchanged",
        varied(PI, "measured_before"),
    ),
    Variant(
        "eq_force2",
        "K_N = 100 N",
        "the body rolls over",
        "K_N = 10 N, or further outputs",
        case(UNKNOWN, PRINTED_HANDS),
    ),
)  # fmt: skip

HANDS: tuple[Case, ...] = (
    PAPER_HANDS,
    case("fast_turn_paper_hands", NO_FALL_RATE),
    case("fast_turn_paper_hands", NO_ROLL_RATE),
    case(
        "fast_turn_paper_hands", NO_ROLL_RATE, NO_FALL_RATE
    ),
    case("fast_turn_paper_hands", ("plant.damping.Cm_damp_roll", 4.0)),
    case("fast_turn_paper_hands", ("plant.damping.Cm_damp_roll", 15.0)),
    case("fast_turn_paper_hands", NO_COUPLING),
    case("fast_turn_paper_hands", ("controller.coupling.signs", "yaw_acceleration")),
    case(
        "fast_turn_paper_hands",
        ("controller.dynamics", None),
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
    (name, settings): case(name, *settings) for settings in LIMB_SETTINGS for name in (UNKNOWN, PI, PI_Q3)
}


class Sweep(NamedTuple):
    """One parameter of UTC over several values, the scenarios' own among them."""

    setting: str
    label: str
    values: tuple[float, ...]
    logarithmic: bool
    ticks: tuple[float, ...]  # none: as the figure likes

    def cases(self, scenario: str) -> list[Case]:
        """The scenario with each value."""
        return [case(scenario, (self.setting, value)) for value in self.values]


P_ERR = Sweep(
    "controller.P_err", "$P_{err}$ [(rad/s)$^2$]", (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0), True, ()
)
W0 = Sweep("controller.W0", "$W^0$ [1]", (-3.0, -1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 0.9), False, ())
_STEPS = (2, 3, 5, 7, 10, 14, 20, 30, 40)
HORIZON = Sweep("controller.horizon_steps", "prediction steps $N$", _STEPS, True, (2, 5, 10, 20, 40))
SWEEPS = (P_ERR, W0, HORIZON)
SWEPT = (UNKNOWN, PI)


def all_cases() -> dict[str, Case]:
    """Every case of the comparison, once, by its command."""
    cases = [
        *FIGURES.values(),
        *CONFIGURATIONS.values(),
        *LAYOUTS,
        *(variant.flown for variant in VARIANTS if variant.flown is not None),
        *HANDS,
        *LIMBS.values(),
        *(one for sweep in SWEEPS for scenario in SWEPT for one in sweep.cases(scenario)),
    ]
    return {one.command: one for one in cases}
