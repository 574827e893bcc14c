# SPDX-License-Identifier: Apache-2.0
"""Joint angles from bags and CSV files; an error names the line and the column."""

import numpy as np
import pytest
from recordings import JOINTS, STRING, added, bag_of_postures, named, text, write_run
from refusals import assert_refused
from runs import cart, run_of

from skydiver_utc.body.posture import joint_angle_names
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.joint_angles import read_joint_angles

NAMES = joint_angle_names()


@pytest.mark.parametrize("namespace", ["/skydiver", "/anna"])
def test_postures_come_back_from_a_bag(tmp_path, namespace):
    """Every eighth step of 0.05 s; of two messages of one stamp the first counts."""
    postures = np.random.default_rng(1).normal(size=(5, 45))
    found = read_joint_angles(bag_of_postures(tmp_path / "run", postures, NAMES, namespace), NAMES)
    assert found.names == NAMES
    np.testing.assert_array_equal(found.values, postures)
    np.testing.assert_allclose(found.time_s, 0.4 * np.arange(5), atol=1e-12)


def test_a_posture_that_cannot_be_used_is_left_out(tmp_path):
    run = run_of(scenario=cart())
    postures = np.random.default_rng(1).normal(size=(4, 45))
    postures[2, 7] = np.nan
    rows = [named(run.scenario, k, NAMES, row) for k, row in enumerate(postures)]
    rows += [named(run.scenario, 4, NAMES, np.zeros(44)), named(run.scenario, 5, NAMES[::-1], postures[1])]
    steps = enumerate([*rows, b"no message"])
    never = 2**63 // run.scenario.dt_ns + 1
    edit = added(*(("joint_states", JOINTS, k, row) for k, row in [*steps, (never, b"")]))
    found = read_joint_angles(write_run(tmp_path / "run", run, edit), NAMES)
    np.testing.assert_array_equal(found.values, [*postures[[0, 1, 3]], postures[1][::-1]])
    assert found.note.startswith("4 ")


def test_a_bag_of_other_joints_or_of_none_is_refused(tmp_path):
    folder = bag_of_postures(tmp_path / "other", np.zeros((3, 2)), ["left_wing_flexion", "tail_flexion"])
    with pytest.raises(RecordingError, match="45 joint angles"):
        read_joint_angles(folder, NAMES)
    with pytest.raises(RecordingError, match="/skydiver/joint_states"):
        read_joint_angles(write_run(tmp_path / "none", run_of(scenario=cart())), NAMES)
    edit = added(("joint_states", STRING, 0, text("of another type")))
    with pytest.raises(RecordingError, match="45 joint angles"):
        read_joint_angles(write_run(tmp_path / "text", run_of(scenario=cart()), edit), NAMES)


def read(tmp_path, text):
    path = tmp_path / "measured.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_joint_angles(path, NAMES)


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_csv_file_is_read(tmp_path, ending, mark):
    lines = ["time_s, left_knee_flexion_deg,neck_rotation", "0,90,-18", "", "0.5,1e1,0", ""]
    found = read(tmp_path, mark + ending.join(lines))
    assert found.names == ("left_knee_flexion", "neck_rotation")
    np.testing.assert_array_equal(found.time_s, [0.0, 0.5])
    np.testing.assert_allclose(found.values, [[np.pi / 2, -np.pi / 10], [np.pi / 18, 0.0]])


@pytest.mark.parametrize(
    ("lines", "degrees"),
    [
        ("time_s,neck_rotation\n200,180\n300,1", [180.0, 1.0]),
        ("time_s,left_knee_flexion_deg,neck_rotation\n0,1,2\n1,3,1", [1.0, 3.0]),
    ],
)
def test_angles_are_in_degrees_where_one_is_no_radian_or_the_first_column_says_so(tmp_path, lines, degrees):
    np.testing.assert_allclose(np.rad2deg(read(tmp_path, lines).values[:, 0]), degrees)


HEAD = "time_s,left_knee_flexion,neck_rotation\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["two postures"]),
        (HEAD + "0,1,2\n", ["two postures"]),
        ("t,left_knee_flexion\n0,1\n1,2\n", ["line 1", "time_s", "'t'", NAMES[0]]),
        ("time_s\n0\n1\n", ["line 1", "joint angles"]),
        ("time_s,left_knee_flexon\n0,1\n1,2\n", ["line 1, column 2", "left_knee_flexion"]),
        ("time_s,xyzzy\n0,1\n1,2\n", ["line 1, column 2", "'xyzzy'", NAMES[0]]),
        (
            "time_s,neck_rotation,neck_rotation_deg\n0,1,2\n1,2,3\n",
            ["line 1, column 3", "neck_rotation"],
        ),
        (HEAD + "0,1,2\n1,2\n", ["line 3"]),
        (HEAD + "0,1,2\n1,2,3,4\n", ["line 3"]),
        (HEAD + "0,1,2\n1,two,3\n", ["line 3, column left_knee_flexion", "'two'"]),
        (HEAD + "0,1,2\n1,2,\n", ["line 3, column neck_rotation", "''"]),
        (HEAD + "0,1,nan\n1,2,3\n", ["line 2, column neck_rotation", "'nan'"]),
        (HEAD + "0,1,2\ninf,2,3\n", ["line 3, column time_s", "'inf'"]),
        (HEAD + "0,1,2\n1,2,181\n", ["line 3, column neck_rotation", "181"]),
        (HEAD + "0,1,20\n\n0,2,3\n", ["line 4, column time_s"]),
        (HEAD + "0,1,20\n1,2,3\n0.5,2,3\n", ["line 4, column time_s", "0.5", "above 1"]),
        (b"time_s,neck_rotation\n0,\xff\n1,2\n", ["UTF-8"]),
        (HEAD + "0,1,2\n1,3.141592653589793,-3.1\n", ["radians", "left_knee_flexion_deg"]),
        (HEAD + "0,1_0,20\n1,2,3\n", ["line 2, column left_knee_flexion", "'1_0'"]),
        (HEAD + '0,1,"2\n1,2,3\n', ["no CSV file"]),
    ],
)
def test_a_fault_in_a_csv_file_is_one_sentence(tmp_path, text, words):
    assert_refused(["measured.csv", *words], read, tmp_path, text, kind=RecordingError)
