# SPDX-License-Identifier: Apache-2.0
"""Kinds of the user's own, `module:Class`: found beside the scenario file, refused by name if wrong."""

import pytest

from skydiver_utc.parameters import ParameterError, from_yaml, load_scenario, to_yaml

MODULE = """
from typing import Annotated
from skydiver_utc.parameters import SlotSettings, quantity

class Wave:
    class Settings(SlotSettings):
        height: Annotated[float, quantity("rad/s", "height of the wave", gt=0)]
        pattern: str = "steep"

class Bare:
    pass
"""
SCENARIO = """
name: own
duration_s: 1.0
dt_s: 0.0042
plant: {{kind: skydiver}}
controller: {{kind: pose}}
reference: {{{reference}}}
"""


@pytest.fixture
def load(tmp_path):
    """Load a scenario with this reference, from a folder that holds the module of its kind."""
    (tmp_path / "own_waves.py").write_text(MODULE)

    def loaded(reference):
        path = tmp_path / "own.yaml"
        path.write_text(SCENARIO.format(reference=reference))
        return load_scenario(str(path))

    return loaded


def test_a_kind_of_one_s_own_is_found_beside_its_scenario_and_comes_back(load):
    scenario = load("kind: 'own_waves:Wave', height: 2, pattern: turn")
    assert (scenario.reference.height, scenario.reference.pattern) == (2.0, "turn")
    assert from_yaml(to_yaml(scenario)) == scenario


@pytest.mark.parametrize(
    ("reference", "words"),
    [
        ("kind: 'own_waves:Wave', height: -1", ["reference.height", "greater than 0"]),
        (
            "kind: 'own_waves:Wave', hight: 1",
            ["reference.hight", "did you mean reference.height", "missing"],
        ),
        ("kind: 'own_waves:Surf', height: 1", ["reference.kind", "own_waves", "Surf"]),
        ("kind: 'own_waves:Bare'", ["reference.kind", "own_waves:Bare", "Settings"]),
        ("kind: 'no_waves:Wave'", ["reference.kind", "no_waves.py"]),
    ],
)
def test_a_wrong_one_is_named(load, reference, words):
    with pytest.raises(ParameterError) as caught:
        load(reference)
    for word in words:
        assert word in str(caught.value)
