# SPDX-License-Identifier: Apache-2.0
"""The amplitude of the fast turn that a subject reaches, as docs/model.md has it."""

import json
import re
from pathlib import Path

import pytest
from command_line import invoke
from skydivers import skydiver

from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.studies.reachable import fast_turn, reachable_amplitude, tracked

SUBJECTS = sorted(path.stem for path in (config_folder() / "subjects").glob("*.yaml"))
SUITS = sorted(path.stem for path in (config_folder() / "suits").glob("*.yaml"))


ROWS = re.findall(
    r"^\| `(\w+)` \| `(\w+)` \| `(\w+)` \|.* (\d+) \|$",
    (Path(__file__).parents[2] / "docs" / "model.md").read_text(encoding="utf-8"),
    re.MULTILINE,
)
AMPLITUDES = {tuple(names): int(amplitude) for *names, amplitude in ROWS}  # by subject, suit and posture


def scenario_of(subject, suit, posture):
    return skydiver(posture=posture, subject=subject, subject__suit=suit)


def turn_at(names, amplitude):
    turn = fast_turn(scenario_of(*names))
    reference = turn.reference.replace(amplitude_deg_s=float(amplitude))
    return turn.replace(reference=reference)


def test_the_table_has_every_subject_and_suit():
    """All but those of the paper's skydiver, and the suit rig, in which no turn is flown: docs/model.md says why."""
    subjects, suits = set(SUBJECTS) - {"paper"}, set(SUITS) - {"paper", "rig"}
    assert {names[:2] for names in AMPLITUDES} == {(subject, suit) for subject in subjects for suit in suits}


@pytest.mark.long
@pytest.mark.parametrize(
    "names", [("light", "standard", "neutral_female_standard"), ("average", "formation", "neutral")]
)
def test_the_amplitude_of_the_table_is_tracked_and_the_next_is_not(names):
    assert tracked(turn_at(names, AMPLITUDES[names]))
    assert not tracked(turn_at(names, AMPLITUDES[names] + 10))


@pytest.mark.parametrize(
    ("fails_at", "reached"), [({200}, 0), ({210}, 200), ({350, 380}, 340), ({410, 420}, 400)]
)
def test_an_amplitude_counts_when_every_smaller_one_is_tracked(fails_at, reached):
    flown = []

    def is_tracked(turn):
        flown.append(turn.reference.amplitude_deg_s)
        return flown[-1] not in fails_at

    assert reachable_amplitude(scenario_of("average", "formation", "neutral"), is_tracked) == reached
    assert flown == [float(a) for a in range(200, min(fails_at) + 1, 10)]


def test_the_fast_turn_is_the_subject_s_own(monkeypatch):
    """Its speed where drag carries the weight, and the damping's S L^2 larger with the body."""
    average, heavy = (fast_turn(scenario_of(s, "formation", "neutral")) for s in ("average", "heavy"))
    assert average.plant.initial.fall_speed_m_s == pytest.approx(57.22, abs=0.01)
    assert heavy.plant.initial.fall_speed_m_s > 59
    damping = average.plant.damping
    assert (damping.reference_area_m2, damping.reference_length_m) == pytest.approx((1.4, 1.78))
    # 98 kg and 1.88 m instead of 80 kg and 1.78 m: areas with the root of mass times height.
    larger = heavy.plant.damping
    assert larger.reference_length_m == pytest.approx(1.88)
    assert larger.reference_area_m2 == pytest.approx(1.4 * (98 / 80 * 1.88 / 1.78) ** 0.5)
    # Whatever subject a suit's areas are written for; the fall in it does not count.
    monkeypatch.setattr("skydiver_utc.studies.reachable.in_straight_fall", lambda scenario: scenario)
    assert all(fast_turn(scenario_of("average", suit, "neutral")).plant.damping == damping for suit in SUITS)


def test_trim_prints_the_amplitude_if_asked(monkeypatch):
    monkeypatch.setattr("skydiver_utc.studies.reachable.tracked", lambda turn, _: "240" not in turn.name)
    assert json.loads(invoke("trim", "--json", "--reachable").stdout)["reachable_turn_deg_s"] == 230
