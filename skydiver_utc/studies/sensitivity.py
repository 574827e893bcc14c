# SPDX-License-Identifier: Apache-2.0
"""Sensitivity of the paper's results to the plant's calibration: the same flights with its numbers up to 10 % off."""

from collections.abc import Mapping, Sequence
from itertools import islice

import numpy as np

from skydiver_utc.parameters import Parameters, Scenario, override
from skydiver_utc.plants.skydiver.trim import in_straight_fall
from skydiver_utc.studies.cases import Measures
from skydiver_utc.studies.design import number_at
from skydiver_utc.studies.markdown import figure, percent, table
from skydiver_utc.studies.paper_cases import BARS, CONVERGED_S, NECESSARY, PAPER_UTC

_REACH = 0.1
_ALL_AT_ONCE, _SEED = 16, 1

_AREAS = "plant.subject.suit.drag_areas_m2"
# What is calibrated, by dotted names below the scenario; of the areas 0 is the front and 1 the side.
NUMBERS: dict[str, tuple[str, ...]] = {
    "trunk, side": (f"{_AREAS}.upper_trunk.1", f"{_AREAS}.mid_trunk.1"),
    **{
        f"{limb.replace('_', ' ')}, {side}": (f"{_AREAS}.{limb}.{entry}",)
        for limb in ("upper_arm", "forearm", "thigh", "shank")
        for entry, side in enumerate(("front", "side"))
    },
    "pitch": ("plant.initial.pitch_deg",),
    "roll damping": ("plant.damping.Cm_damp_roll",),
    "pitch damping": ("plant.damping.Cm_damp_pitch",),
    "reference area": ("plant.damping.reference_area_m2",),
    "force of the hands": ("plant.hands.K_N",),
    "acceleration of the limbs": ("plant.limbs.alpha_acceleration",),
}


class Calibration(Parameters):
    """The three configurations with some numbers changed: RMSE with and without hands [deg/s], when converged."""

    changed: str
    rmse: tuple[float | None, ...]
    without_hands: tuple[float | None, ...]
    converged_s: tuple[float | None, ...]

    @property
    def kept(self) -> dict[str, bool]:
        """Which of the paper's results are left."""
        rmse, without, times = (
            [float("inf") if value is None else value for value in values]
            for values in (self.rmse, self.without_hands, self.converged_s)
        )
        return {
            "tracks": all(value <= bar for value, bar in zip(rmse, BARS, strict=True)),
            f"converges by {CONVERGED_S:g} s": max(times) <= CONVERGED_S,
            "needs the hands": all(w >= NECESSARY * r for w, r in zip(without, rmse, strict=True)),
            "modelled better": rmse[1] < rmse[0],
        }


def calibrations() -> dict[str, dict[str, float]]:
    """By name, the factor on each number: each alone both ways, and all at once at random."""
    alone = {
        f"{name} x {factor:g}": {name: factor} for name in NUMBERS for factor in (1 - _REACH, 1 + _REACH)
    }
    drawn = np.random.default_rng(_SEED).uniform(1 - _REACH, 1 + _REACH, (_ALL_AT_ONCE, len(NUMBERS)))
    together = {
        f"all at once, {k}": dict(zip(NUMBERS, row.tolist(), strict=True)) for k, row in enumerate(drawn, 1)
    }
    return {"as calibrated": {}} | alone | together


def changed(scenario: Scenario, factors: Mapping[str, float]) -> Scenario:
    """The scenario with its numbers times these factors, and its posture trimmed again; the pattern is kept."""
    own = scenario.as_dict()
    names = {name: factor for label, factor in factors.items() for name in NUMBERS[label]}
    values = {name: factor * number_at(own, name) for name, factor in names.items()}
    return in_straight_fall(override(scenario, values)) if values else scenario


def sensitivity_flights(count: int | None) -> dict[str, Scenario]:
    """The three configurations, with and without hands, on every calibration, or on the first so many."""
    configurations, scenarios = [one.load() for one in PAPER_UTC], {}
    for name, factors in islice(calibrations().items(), count):
        plant = changed(configurations[0], factors).plant
        for k, one in enumerate(configurations):
            scenarios[f"{name}/{k}"] = one.replace(plant=plant)
            scenarios[f"{name}/{k}/-"] = one.replace(plant=plant.replace(hands=plant.hands.replace(K_N=0.0)))
    return scenarios


def sensitivity(found: Mapping[str, Measures]) -> tuple[Calibration, ...]:
    """The results of `sensitivity_flights` by calibration."""
    return tuple(
        Calibration(
            changed=name,
            rmse=tuple(found[f"{name}/{k}"].rmse_deg_s for k in range(3)),
            without_hands=tuple(found[f"{name}/{k}/-"].rmse_deg_s for k in range(3)),
            converged_s=tuple(found[f"{name}/{k}"].convergence_time_s for k in range(3)),
        )
        for name in calibrations()
        if f"{name}/0" in found
    )


def sensitivity_section(found: Sequence[Calibration]) -> str:
    """The study's part of the page."""
    rows = [
        (
            one.changed,
            *(", ".join(map(figure, values)) for values in (one.rmse, one.without_hands, one.converged_s)),
            ", ".join(name for name, holds in one.kept.items() if not holds) or "-",
        )
        for one in found
    ]
    counts = (f"{name} in {sum(one.kept[name] for one in found)}" for name in found[0].kept)
    head = ("changed", "RMSE", "without hands", "converged [s]", "lost")
    return f"""## Sensitivity to the calibration

The three configurations with the plant's calibrated numbers {percent(_REACH)} off, one by one and all at once, the
posture trimmed again. Of {len(found)} plants: {", ".join(counts)}.

{table(head, rows)}"""
