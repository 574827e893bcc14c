# SPDX-License-Identifier: Apache-2.0
"""Kinds of the user's own, `module:Class`: found beside the scenario file, refused by name if wrong."""

import sys

import pytest
from refusals import assert_refused

from skydiver_utc.parameters import ParameterError, from_yaml, load_scenario, to_yaml

MODULE = """
from typing import Annotated
from skydiver_utc.parameters import SlotSettings, quantity

class Wave:
    class Settings(SlotSettings):
        height: Annotated[float, quantity("rad/s", "height of the wave", gt=0)]
        pattern: str = "steep"
        shares: list[float] = []

class Bare:
    pass
"""
SCENARIO = """
name: own
duration_s: 1.0
dt_s: 0.0042
plant: {{{plant}}}
controller: {{kind: pose}}
reference: {{{reference}}}
"""


@pytest.fixture
def load(tmp_path):
    """Load a scenario with this reference, from a folder that holds the module of its kind."""
    (tmp_path / "own_waves.py").write_text(MODULE)
    (tmp_path / "broken_waves.py").write_text("import no_such_dependency")
    (tmp_path / "misspelt_waves.py").write_text("class Wave")
    (tmp_path / "folder_of_waves").mkdir()

    def loaded(reference, plant="kind: skydiver"):
        path = tmp_path / "own.yaml"
        path.write_text(SCENARIO.format(reference=reference, plant=plant))
        return load_scenario(str(path))

    return loaded


def test_a_kind_of_one_s_own_is_found_beside_its_scenario_and_comes_back(load):
    scenario = load("kind: 'own_waves:Wave', height: 2, pattern: turn, shares: [0.5, 1]")
    assert (scenario.reference.height, scenario.reference.pattern) == (2.0, "turn")
    assert scenario.reference.shares == [0.5, 1.0]
    assert from_yaml(to_yaml(scenario)) == scenario


def test_a_packaged_scenario_takes_a_kind_from_the_current_folder(tmp_path, monkeypatch):
    module = f"waves_of_{tmp_path.name}"
    (tmp_path / f"{module}.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*sys.path])
    changed = load_scenario("bank_recovery", {"reference": {"kind": f"{module}:Wave", "height": 2}})
    assert changed.reference.height == 2.0


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
        ("kind: 'broken_waves:Wave'", ["reference.kind", "no_such_dependency.py"]),
        ("kind: 'misspelt_waves:Wave'", ["reference.kind", "misspelt_waves.py, line 1"]),
    ],
)
def test_a_wrong_one_is_named(load, reference, words):
    assert_refused(words, load, reference)


@pytest.mark.parametrize("name", ["{0}", "{0}_package.inner"])
@pytest.mark.parametrize("written_for_this", [True, False])
def test_a_text_from_anywhere_imports_no_other_code(tmp_path, monkeypatch, name, written_for_this):
    """Only a module that imports this package, as one with a class for it does."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*sys.path])
    module = name.format(f"waves_{tmp_path.name}")
    path = tmp_path / f"{module.replace('.', '/')}.py"
    path.parent.mkdir(exist_ok=True)
    source = MODULE if written_for_this else "class Wave:\n    pass\n"
    path.write_text(f"open({str(tmp_path / 'run')!r}, 'w')\n{source}")
    text = to_yaml(
        load_scenario("bank_recovery", {"reference": {"kind": "constant", "values": {"yaw_rate": 0.0}}})
    )
    text += f"disturbances: [{{kind: '{module}:Wave', height: 1}}]\n"
    text = text.replace("disturbances: []\n", "", 1)
    if written_for_this:
        assert from_yaml(text).disturbances[0].height == 1.0
    else:
        with pytest.raises(ParameterError, match=module):
            from_yaml(text)
    assert (tmp_path / "run").exists() == written_for_this


def test_a_text_from_anywhere_imports_no_plain_module_on_the_way(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "plain_waves.py").write_text(f"open({str(tmp_path / 'run')!r}, 'w')")
    (tmp_path / "inner.py").write_text(MODULE)
    text = to_yaml(load_scenario("bank_recovery")).replace("kind: pose", "kind: plain_waves.inner:Wave")
    with pytest.raises(ParameterError):
        from_yaml(text)
    assert not (tmp_path / "run").exists()


def test_a_plant_of_one_s_own_names_no_files(load):
    """What is the name of a posture for the skydiver is a text for it."""
    scenario = load(
        "kind: constant, values: {y: 0}", plant="kind: 'own_waves:Wave', height: 2, pattern: turn"
    )
    assert scenario.plant.pattern == "turn"
    text = to_yaml(scenario).replace("own_waves:Wave", "folder_of_waves:Wave")
    with pytest.raises(ParameterError, match="does not import skydiver_utc"):
        from_yaml(text)
