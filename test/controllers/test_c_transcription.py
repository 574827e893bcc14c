# SPDX-License-Identifier: Apache-2.0
"""The C transcription that `make bench` times does the same arithmetic as the package."""

import weakref

import numpy as np
import pytest
from c_transcription import FLAGS, address, compiler, library
from controllers import AGREEMENT, FAST, largest_difference

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario

needs_compiler = pytest.mark.skipif(compiler() is None, reason="there is no C compiler named cc")


@needs_compiler
@pytest.mark.parametrize(("steps", "flags"), [(5, ("-O1",)), (20, FLAGS)], ids=str)
def test_c_flies_the_fast_turn_as_the_package_does(steps, flags):
    """Controls, predictions and deviations of U over two seconds, C with U and Pu of its own throughout."""
    scenario = load_scenario(FAST, {"duration_s": 2.0, "controller.horizon_steps": steps})
    with library(flags) as loaded:
        assert largest_difference(loaded, simulate(scenario)) <= AGREEMENT


def test_an_address_holds_its_array():
    """C reads states long after the flight that they are of has gone out of sight."""
    flown = np.zeros((2, 13))
    alive = weakref.ref(flown)
    held = address(flown[1])
    del flown
    assert alive() is not None
    assert held.value == alive()[1].ctypes.data
