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
THREE = (UNKNOWN, PI, PI_Q3)  # the paper's configurations of UTC: figures utc_m0_c2, utc_m1_c2, utc_m1_c3
UNKNOWN_INSENSITIVE, PI_INSENSITIVE = f"{UNKNOWN}_insensitive", f"{PI}_insensitive"
NO_COUPLING = ("controller.coupling.signs", "none")
BY_ACCELERATION = ("controller.coupling.signs", "yaw_acceleration")
IDLE, DORSAL = ("plant.hands.K_N", 0.0), ("plant.hands.force", "dorsal")

POSE_FAST, POSE_SLOW = case("fast_turn_pose_only"), case("slow_turn_pose_only")
LQR_FAST, LQR_SLOW = case("fast_turn_lqr"), case("slow_turn_lqr")
LQR_BOTH = case("fast_turn_lqr", ("reference.amplitude_deg_s", 180.0), ("reference.frequency_hz", 0.1))
M0_C2, M1_C2, M1_C3 = PAPER_UTC = tuple(map(case, THREE))
M0_C3 = case(UNKNOWN, BY_ACCELERATION)
M0_NONE, M1_NONE = case(UNKNOWN, NO_COUPLING), case(PI, NO_COUPLING)
M0_SHORT, M1_LONG = case(UNKNOWN, ("controller.horizon_steps", 5)), case(PI, ("controller.horizon_steps", 20))
POSTURE_ALONE = case(UNKNOWN, IDLE, ("plant.limits.Cm_damp_yaw", [0.499, 0.501]))
LAYOUTS = (case("front_layout"), case("back_layout"))

# Of the three configurations: bars of the RMSE [deg/s], the paper's "around 2 s", and times worse without hands.
BARS = (4.0, 3.0, 2.0)
CONVERGED_S = 2.0
NECESSARY = 3.0

# The paper's figures of a flight, by their LaTeX labels.
FIGURES = {"ff6": POSE_FAST, "utc_m0_c2": M0_C2, "utc_m1_c2": M1_C2, "utc_m1_c3": M1_C3}

# What stands between commas: dynamics of alpha in the prediction, what couples the hands with the yaw damping, steps.
CONFIGURATIONS: dict[str, Case] = {
    "pose controller, fast turn (`ff6`)": POSE_FAST,
    "pose controller, slow turn": POSE_SLOW,
    "linear-quadratic regulator, fast turn": LQR_FAST,
    "linear-quadratic regulator, slow turn, costs of its own": LQR_SLOW,
    "linear-quadratic regulator, slow turn, costs of the fast one": LQR_BOTH,
    "UTC: unknown, yaw rate (eq_q1), 20 (`utc_m0_c2`)": M0_C2,
    "UTC: unknown, yaw acceleration (eq_q3), 20": M0_C3,
    "UTC: unknown, nothing, 20": M0_NONE,
    "UTC: unknown, yaw rate, 5": M0_SHORT,
    "UTC: modelled (eq:m1utc), yaw rate, 5 (`utc_m1_c2`)": M1_C2,
    "UTC: modelled, nothing, 5": M1_NONE,
    "UTC: modelled, yaw rate, 20": M1_LONG,
    "UTC: modelled, yaw acceleration, 5 (`utc_m1_c3`)": M1_C3,
    "the posture alone, flown by UTC": POSTURE_ALONE,
}


def three(*settings: tuple[str, object], insensitive: bool = False) -> list[Case]:
    """The paper's three configurations of UTC under some settings; insensitive: alpha's sign by the damping."""
    if not insensitive:
        return [case(name, *settings) for name in THREE]
    rate = case(PI_INSENSITIVE, *settings)
    if NO_COUPLING[0] not in dict(settings):
        rate = case(PI_INSENSITIVE, *settings, BY_ACCELERATION)
    return [case(UNKNOWN_INSENSITIVE, *settings), case(PI_INSENSITIVE, *settings), rate]


# Flights of the three configurations, by words.
AS_PRINTED = "as printed"
NO_HANDS, FORCE_ALONE, MOMENT_ALONE = (
    "no hands",
    "force alone, no roll moment",
    "roll moment alone, 1 % of the force",
)
HANDS: dict[str, list[Case]] = {
    AS_PRINTED: three(),
    NO_HANDS: three(IDLE),
    FORCE_ALONE: three(("plant.hands.lx_m", 0.0)),
    MOMENT_ALONE: three(("plant.hands.K_N", 1.0), ("plant.hands.lx_m", 35.0)),
    "dorsal force": three(DORSAL),
}
LIMBS: dict[str, list[Case]] = {
    AS_PRINTED: three(),
    "no reaction of moving limbs": three(("plant.limbs.reaction", False)),
}
INSENSITIVE: dict[str, list[Case]] = {
    AS_PRINTED: three(),
    "sign by the damping": three(insensitive=True),
    "the same, hands coupled by the yaw acceleration": three(BY_ACCELERATION, insensitive=True),
    "the same without coupling of the hands": three(NO_COUPLING, insensitive=True),
    "the same with 5 steps": three(("controller.horizon_steps", 5), insensitive=True),
    "the same with no hands": three(IDLE, insensitive=True),
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
        "first covariance Pu, printed indefinite",
        "only the real part of its root",
        "eigenvalue -0.208; Qu = 0.1 Pu brings it back every step",
        "negative eigenvalues are lifted before each root (`repaired_covariance`)",
        varied(UNKNOWN, "indefinite_covariance"),
    ),
    Variant(
        "sign of alpha's coupling (eq:s14)",
        "the same in right turns",
        "alpha goes the wrong way in right turns",
        "times the sign of the yaw rate",
        varied(UNKNOWN, "unsigned_s14"),
    ),
    Variant(
        "its hysteresis",
        "none",
        "harmless: as printed the sign flips each step while the turn speeds up",
        "as printed",
        varied(UNKNOWN, "no_hysteresis"),
    ),
    Variant(
        "its look-ahead",
        "always 1 s, as in the words",
        "alpha leads the turn by a second",
        "as printed",
        varied(UNKNOWN, "always_ahead"),
    ),
    Variant(
        "the sign itself",
        "by the damping left; not the paper's",
        "insensitive to tuning (docs/findings.md)",
        "as printed",
        case(UNKNOWN_INSENSITIVE),
    ),
    Variant(
        "which control is saved for the update (eq:xpred), alpha unknown",
        "that of the horizon's last step",
        "the slew limit distorts the spread",
        "the sigma point as drawn and bounded",
        varied(UNKNOWN, "saved_at_horizon"),
    ),
    Variant(
        "the same, alpha modelled",
        "that of the horizon's last step",
        "the increments of the whole horizon act in one step: limit cycle at the start",
        "that of the first step, which acts next",
        varied(PI, "saved_at_horizon"),
    ),
    Variant(
        "dynamics of alpha (eq:m1utc)",
        "positional, as in the block diagram",
        "the sigma point's own alpha is thrown away",
        "in increments",
        varied(PI, "positional"),
    ),
    Variant(
        "its first increment",
        "from the yaw rate measured one step before",
        "alpha winds away",
        "the yaw rate before the first step counts as unchanged",
        varied(PI, "measured_before"),
    ),
    Variant(
        "weights of the mean (eq:zpred)",
        "(1 - W0) / 2m for the centre as well",
        "they sum to .844",
        "W0 for the centre (eq:sigp)",
        varied(UNKNOWN, "printed_weights"),
    ),
    Variant(
        "mirrored sigma points (eq:movep)",
        'after the bounds, "bounded"',
        "the rule can never act",
        "before the bounds",
        varied(UNKNOWN, "moved_after_bounds"),
    ),
    Variant("n in the spread of the points (eq:sigp)", "not defined", "", "n = m", None),
    Variant(
        "force of the hands (eq_force2)",
        "dorsal, as the words have it: the air's reaction",
        "both hands together brake the fall, and with it the yaw moment",
        "ventral, as the formula has it in right-handed axes (docs/model.md)",
        case(UNKNOWN, DORSAL),
    ),
)


class Sweep(NamedTuple):
    """One parameter of UTC over several values, the scenarios' own among them."""

    setting: str
    label: str
    values: tuple[float, ...]
    logarithmic: bool

    def cases(self, scenario: str) -> list[Case]:
        """The scenario with each value."""
        return [case(scenario, (self.setting, value)) for value in self.values]


P_ERR = Sweep("controller.P_err", "P_err [(rad/s)^2]", (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0), True)
W0 = Sweep("controller.W0", "W0 [1]", (-3.0, -1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 0.9), False)
_STEPS = (2, 3, 5, 7, 10, 14, 20, 30, 40)
HORIZON = Sweep("controller.horizon_steps", "prediction steps N", _STEPS, False)
SWEEPS = (P_ERR, W0, HORIZON)
SWEPT = {UNKNOWN: "alpha unknown", PI: "alpha modelled"}


def all_cases() -> dict[str, Case]:
    """Every case of the comparison, once, by its command."""
    cases = [
        *FIGURES.values(),
        *CONFIGURATIONS.values(),
        *LAYOUTS,
        *(variant.flown for variant in VARIANTS if variant.flown is not None),
        *(one for group in (HANDS, LIMBS, INSENSITIVE) for row in group.values() for one in row),
        *(one for sweep in SWEEPS for scenario in SWEPT for one in sweep.cases(scenario)),
    ]
    return {one.command: one for one in cases}
