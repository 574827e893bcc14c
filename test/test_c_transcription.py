"""The C transcription that `make bench` times does the same arithmetic as the package."""

import pytest
from c_transcription import FLAGS, compiler, library
from controllers import AGREEMENT, FAST, largest_difference

from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.closed_loop import simulate

pytestmark = pytest.mark.skipif(compiler() is None, reason="there is no C compiler named cc")


@pytest.mark.parametrize("steps", [5, 20])
@pytest.mark.parametrize("flags", [FLAGS, ("-O1",)], ids=["as timed", "strict"])
def test_c_flies_the_fast_turn_as_the_package_does(steps, flags):
    """Controls, predictions and deviations of U over three seconds, C with U and Pu of its own throughout."""
    scenario = load_scenario(FAST, {"duration_s": 3.0, "controller.horizon_steps": steps})
    with library(flags) as loaded:
        assert largest_difference(loaded, simulate(scenario)) <= AGREEMENT
