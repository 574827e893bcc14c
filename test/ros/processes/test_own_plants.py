# SPDX-License-Identifier: Apache-2.0
"""A plant of the user's own over ROS: run, analysed and replayed from other folders than its module's."""

import json
from pathlib import Path

import pytest
from command_line import call

pytestmark = pytest.mark.processes

PLANTS = Path(__file__).parents[3] / "examples" / "own_plant"


@pytest.mark.parametrize(("name", "state"), [("pendulum", "JointState"), ("quadrotor", "Odometry")])
def test_a_plant_of_ones_own_is_run_analysed_and_checked(tmp_path: Path, name: str, state: str) -> None:
    bag = tmp_path / "bag"
    given = ("--set", "duration_s=0.5", "--out", bag, "--quiet", "--json")
    code, stdout, stderr = call("run", PLANTS / f"{name}.yaml", *given, folder=tmp_path)
    assert code == 0, stderr
    assert json.loads(stdout)["outcome"] == "completed"
    assert state in (bag / "metadata.yaml").read_text(encoding="utf-8")

    # A recording may come from anybody: no code is imported from its folder.
    (bag / f"{name}.py").write_text((PLANTS / f"{name}.py").read_text(encoding="utf-8"), encoding="utf-8")
    code, _, stderr = call("analyse", bag, folder=tmp_path)
    assert code != 0
    (line,) = stderr.splitlines()
    assert f"{name}.py" in line

    assert call("analyse", bag, folder=PLANTS)[0] == 0
    code, stdout, stderr = call("replay", "--check", "--json", bag, folder=PLANTS)
    assert code == 0, stderr
    assert json.loads(stdout)["equal"]
