# SPDX-License-Identifier: Apache-2.0
"""A plant of the user's own over ROS: run, analysed and replayed from other folders than its module's."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ros_fixtures import PATIENCE_S

pytest_plugins = ("ros_fixtures",)
pytestmark = pytest.mark.processes

PLANTS = Path(__file__).parents[3] / "examples" / "own_plant"


def command(folder: Path, *arguments: object) -> "subprocess.CompletedProcess[str]":
    """A command of the package, started in this folder."""
    return subprocess.run(
        [sys.executable, "-m", "skydiver_utc", *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])},
        capture_output=True,
        text=True,
        timeout=2 * PATIENCE_S,
        check=False,
    )


@pytest.mark.parametrize(("name", "state"), [("pendulum", "JointState"), ("quadrotor", "Odometry")])
def test_a_plant_of_ones_own_is_run_analysed_and_checked(tmp_path: Path, name: str, state: str) -> None:
    bag = tmp_path / "bag"
    given = ("--set", "duration_s=0.5", "--folder", bag, "--quiet", "--json")
    ran = command(tmp_path, "run", PLANTS / f"{name}.yaml", *given)
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["outcome"] == "completed"
    assert state in (bag / "metadata.yaml").read_text(encoding="utf-8")

    # A recording may come from anybody: no code is imported from its folder.
    (bag / f"{name}.py").write_text((PLANTS / f"{name}.py").read_text(encoding="utf-8"), encoding="utf-8")
    without = command(tmp_path, "analyse", bag)
    assert without.returncode != 0
    (line,) = without.stderr.splitlines()
    assert f"{name}.py" in line

    assert command(PLANTS, "analyse", bag).returncode == 0
    checked = command(PLANTS, "replay", "--check", "--json", bag)
    assert checked.returncode == 0, checked.stderr
    assert json.loads(checked.stdout)["equal"]
