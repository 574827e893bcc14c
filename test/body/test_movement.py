# SPDX-License-Identifier: Apache-2.0
"""A posture path: through its postures, smooth, inside the joint limits, and its geometry table is exact enough."""

import numpy as np
import pytest
from refusals import assert_refused
from skydivers import plant_of, skydiver

from skydiver_utc.body.movement import movement
from skydiver_utc.body.posture import joint_ranges, posture_angles
from skydiver_utc.body.segments import build_body
from skydiver_utc.plants.skydiver.dynamics import posture_geometry
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, build_model, posture_rows
from skydiver_utc.plants.skydiver.table_error import table_error

NAME = "front_layout_open_loop"
SCENARIO = skydiver(NAME)
MOVES = movement(SCENARIO.plant.posture, SCENARIO.plant.pattern)
ALPHAS = np.linspace(0.0, 2.0, 401)


def test_a_path_goes_through_its_postures():
    for keyframe in SCENARIO.plant.pattern.keyframes:
        np.testing.assert_allclose(MOVES.angles(keyframe.alpha), posture_angles(keyframe.posture), atol=1e-12)


def test_the_slope_is_the_derivative_and_does_not_jump():
    step = 1e-6
    for alpha in np.linspace(0.1, 1.9, 19):
        difference = (MOVES.angles(alpha + step) - MOVES.angles(alpha - step)) / (2 * step)
        np.testing.assert_allclose(MOVES.slope(alpha), difference, atol=1e-5)
    slopes = np.array([MOVES.slope(alpha) for alpha in ALPHAS])
    assert np.abs(np.diff(slopes, axis=0)).max() < 0.05


def test_a_path_stays_inside_the_joint_limits():
    lower, upper = joint_ranges(SCENARIO.plant.subject.joint_limits)
    for alpha in ALPHAS:
        angles = MOVES.angles(alpha)
        assert (angles >= lower - 1e-9).all()
        assert (angles <= upper + 1e-9).all()


def test_table_error_bound_of_a_path():
    """Between its 513 nodes the table keeps every entry to 2e-5 (m, m2, kg m2), swing to 1e-2 kg m2.

    The slope of a path has kinks at its postures, which a table of cubics rounds off; the swing follows the slope.
    """
    model, alphas = build_model(SCENARIO.plant, SCENARIO.dt_s), np.linspace(0.0, 2.0, 1001)
    exact, row = posture_rows(build_body(SCENARIO.plant.subject), MOVES, alphas), np.empty(GEOMETRY_SIZE)
    for alpha, expected in zip(alphas, exact, strict=True):
        posture_geometry(model, alpha, row)
        np.testing.assert_allclose(row[:-3], expected[:-3], atol=2e-5)
        np.testing.assert_allclose(row[-3:], expected[-3:], atol=1e-2)


BENT = {"name": "bent", "joint_angles_deg": {"left_knee": [170.0, 0.0, 0.0]}}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"limits__alpha": [-1.0, 2.0]}, "keep the limits within the path"),
        ({"posture": "track"}, "not in posture track at initial.alpha = 0"),
        (
            {"pattern__keyframes": [{"alpha": 0.0, "posture": "neutral"}, {"alpha": 2.0, "posture": BENT}]},
            "posture bent of pattern layout is beyond the joint limits",
        ),
        ({"pattern__keyframes": [{"alpha": 0.0, "posture": "neutral"}]}, "give at least two"),
        (
            {"pattern__keyframes": [{"alpha": 1.0, "posture": name} for name in ("neutral", "track")]},
            "sort them",
        ),
    ],
)
def test_what_makes_no_path_is_refused(settings, words):
    assert_refused(words, plant_of, NAME, **settings)


def spike(at, width):
    """The arms go to track and come back between two nodes of a coarse table."""
    alphas = (0.0, at - width, at, at + width, 2.0)
    names = ("neutral", "neutral", "track", "neutral", "neutral")
    return [{"alpha": alpha, "posture": name} for alpha, name in zip(alphas, names, strict=True)]


@pytest.mark.parametrize(
    ("nodes", "keyframes"), [(9, None), (17, None), (65, spike(1.024, 0.006)), (65, spike(0.4, 0.02))]
)
def test_a_table_too_coarse_for_its_path_is_refused(nodes, keyframes):
    words = (f"plant.pattern_nodes = {nodes} is too few for pattern layout", "raise plant.pattern_nodes")
    of_path = {"pattern__keyframes": keyframes} if keyframes else {}
    assert_refused(words, plant_of, NAME, pattern_nodes=nodes, **of_path)


def test_the_error_of_a_table_is_that_halfway_between_its_nodes():
    straight = [{"alpha": 0.0, "posture": "neutral"}, {"alpha": 2.0, "posture": "head_down"}]
    settings = skydiver(NAME, pattern_nodes=33, pattern__keyframes=straight).plant
    moves, row = movement(settings.posture, settings.pattern), np.empty(GEOMETRY_SIZE)
    model, alphas, errors = build_model(settings, SCENARIO.dt_s, moves), np.arange(0.5, 32.0) / 16.0, []
    for alpha, expected in zip(
        alphas, posture_rows(build_body(settings.subject), moves, alphas), strict=True
    ):
        posture_geometry(model, alpha, row)
        errors.append(np.abs(row - expected)[:48].max())
    assert table_error(settings, model, moves).place == pytest.approx(max(errors))


@pytest.mark.parametrize(
    ("entry", "of"),
    [
        *((0, "place"), (47, "place"), (48, "drag area"), (143, "drag area")),
        *((144, "inertia"), (149, "inertia"), (150, "swing"), (152, "swing")),
    ],
)
def test_an_error_of_a_table_is_that_of_its_entries(entry, of):
    model = build_model(SCENARIO.plant, SCENARIO.dt_s, MOVES)
    before = table_error(SCENARIO.plant, model, MOVES)
    model.geometry[:, entry] += 0.1
    changes = np.subtract(table_error(SCENARIO.plant, model, MOVES), before)
    expected = [0.1 if name == of else 0.0 for name in before._fields]
    np.testing.assert_allclose(changes, expected, atol=0.01)


def test_a_dense_table_and_any_table_of_a_direction_are_taken():
    plant_of(NAME, pattern_nodes=65)
    plant_of(pattern_nodes=9)
