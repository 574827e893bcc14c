# SPDX-License-Identifier: Apache-2.0
"""`view` takes runs, a scenario or a namespace."""

import pytest
from click.testing import CliRunner

from skydiver_utc.cli.main import main


@pytest.mark.parametrize(
    "given",
    [
        [],
        ["run", "--live", "turn_360_left"],
        ["--live", "turn_360_left", "--ros", "anna"],
        ["run", "--set", "seed=1"],
    ],
)
def test_runs_a_scenario_or_a_namespace(given):
    result = CliRunner().invoke(main, ["view", *given])
    assert result.exit_code == 2
    assert "--live" in result.stderr
