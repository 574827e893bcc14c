# SPDX-License-Identifier: Apache-2.0
"""A plant of the user's own over ROS: run and checked from other folders than its module's."""

import json
from pathlib import Path

import pytest
from command_line import call
from recorded import Bag, assert_equals_simulation

pytestmark = pytest.mark.processes

PLANTS = Path(__file__).parents[3] / "examples" / "own_plant"


def test_a_plant_of_ones_own_is_run_as_simulated_and_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, bag = "quadrotor", tmp_path / "bags" / "run"
    given = ("--set", "duration_s=0.5", "--out", bag, "--quiet", "--json")
    code, stdout, stderr = call("run", PLANTS / f"{name}.yaml", *given, folder=tmp_path)
    assert code == 0, stderr
    assert json.loads(stdout)["outcome"] == "completed"
    assert json.loads((bag / "metrics.json").read_text(encoding="utf-8")) == json.loads(stdout)
    assert (bag / "tracking.png").is_file()
    assert "Odometry" in (bag / "metadata.yaml").read_text(encoding="utf-8")

    # A recording may come from anybody: no code is imported from its folder.
    (bag / f"{name}.py").write_text((PLANTS / f"{name}.py").read_text(encoding="utf-8"), encoding="utf-8")
    code, _, stderr = call("analyse", bag, folder=tmp_path)
    assert code != 0
    (line,) = stderr.splitlines()
    assert f"{name}.py" in line

    code, stdout, stderr = call("replay", "--check", "--json", bag, folder=PLANTS)
    assert code == 0, stderr
    assert json.loads(stdout)["equal"]
    monkeypatch.syspath_prepend(str(PLANTS))
    assert_equals_simulation(Bag(bag))
