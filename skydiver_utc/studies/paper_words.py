# SPDX-License-Identifier: Apache-2.0
"""The paper's words on a scenario, beside the metrics of a run."""

from skydiver_utc.parameters import Scenario
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import shipped


def paper_words(scenario: Scenario) -> dict[str, str]:
    """By a part of the metric's label, the paper's claim; empty for a scenario that is not one of the paper's.

    Settings must be the shipped ones, but for duration and seed.
    """
    bars = dict(zip(flown.THREE, flown.BARS, strict=True))
    layouts = [case.scenario for case in flown.LAYOUTS]
    if scenario.name not in (*bars, *layouts):
        return {}
    same = shipped(scenario.name).replace(
        duration_s=scenario.duration_s, seed=scenario.seed, epoch_s=scenario.epoch_s
    )
    if same != scenario:
        return {}
    if scenario.name in layouts:
        return {
            "at the end": "flies front and back layouts, through head to earth",
            "angle turned": "at most 10 deg",
        }
    return {
        "yaw rate: RMSE": f"tracks accurately: taken as at most {bars[scenario.name]:g} deg/s",
        "yaw rate: inside 5 %": f"converges after around {flown.CONVERGED_S:g} s",
    }
