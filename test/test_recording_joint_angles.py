"""Joint angles read from bags and from CSV files; each fault of a file is one sentence that says where it is."""

import numpy as np
import pytest
from test_analysis_metrics import flight_of, scenario_of
from test_analysis_recorded_flight import joint_state, write_bag

from skydiver_utc.body.posture import joint_angle_names
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.joint_angles import read_joint_angles

NAMES = joint_angle_names()
KIND = "sensor_msgs/msg/JointState"


def bag_of(folder, postures, names=NAMES, namespace="/skydiver"):
    """A bag with a posture every eighth step; of the second one a copy with other values comes later."""
    messages = [
        ("joint_states", KIND, 8 * i, joint_state(8 * i, names, row)) for i, row in enumerate(postures)
    ]
    again = ("joint_states", KIND, 8, joint_state(8, names, np.ones(len(names))))
    return write_bag(folder, flight_of(), lambda flown: [*flown, *messages, again], (namespace,))


@pytest.mark.parametrize("namespace", ["/skydiver", "/anna"])
def test_postures_come_back_from_a_bag(tmp_path, namespace):
    postures = np.random.default_rng(1).normal(size=(5, 45))
    found = read_joint_angles(bag_of(tmp_path / "run", postures, namespace=namespace), NAMES)
    assert found.names == NAMES
    np.testing.assert_array_equal(found.values, postures)
    np.testing.assert_allclose(found.time_s, 8 * scenario_of().dt_s * np.arange(5), atol=1e-12)


def test_a_bag_of_other_joints_is_refused(tmp_path):
    folder = bag_of(tmp_path / "run", np.zeros((3, 2)), ["left_wing_flexion", "tail_flexion"])
    with pytest.raises(RecordingError, match="the 45 joint angles of this version"):
        read_joint_angles(folder, NAMES)


def test_a_bag_without_postures_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="has no topic /skydiver/joint_states"):
        read_joint_angles(write_bag(tmp_path / "run", flight_of()), NAMES)


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


HEAD = "time_s,left_knee_flexion,neck_rotation\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["fewer than two postures"]),
        (HEAD + "0,1,2\n", ["fewer than two postures"]),
        ("t,left_knee_flexion\n0,1\n1,2\n", ["line 1", "first column must be time_s", "'t'"]),
        ("time_s\n0\n1\n", ["line 1", "joint angles must follow"]),
        ("time_s,left_knee_flexon\n0,1\n1,2\n", ["line 1, column 2", "did you mean left_knee_flexion"]),
        ("time_s,xyzzy\n0,1\n1,2\n", ["line 1, column 2", "'xyzzy'"]),
        (
            "time_s,neck_rotation,neck_rotation_deg\n0,1,2\n1,2,3\n",
            ["line 1, column 3: neck_rotation stands twice"],
        ),
        (HEAD + "0,1,2\n1,2\n", ["line 3 has 2 columns, the header has 3"]),
        (HEAD + "0,1,2\n1,2,3,4\n", ["line 3 has 4 columns"]),
        (HEAD + "0,1,2\n1,two,3\n", ["line 3, column left_knee_flexion", "'two' is no finite number"]),
        (HEAD + "0,1,2\n1,2,\n", ["line 3, column neck_rotation", "''"]),
        (HEAD + "0,1,nan\n1,2,3\n", ["line 2, column neck_rotation", "'nan'"]),
        (HEAD + "0,1,2\ninf,2,3\n", ["line 3, column time_s", "'inf'"]),
        (HEAD + "0,1,2\n1,2,181\n", ["line 3, column neck_rotation", "181 deg is beyond 180"]),
        (HEAD + "0,1,2\n\n0,2,3\n", ["line 4, column time_s: 0 does not come after 0"]),
        (HEAD + "0,1,2\n1,2,3\n0.5,2,3\n", ["line 4, column time_s: 0.5 does not come after 1"]),
        (b"time_s,neck_rotation\n0,\xff\n1,2\n", ["no CSV file of UTF-8 text"]),
        (HEAD + '0,1,"2\n1,2,3\n', ["no CSV file"]),
    ],
)
def test_a_fault_in_a_csv_file_is_one_sentence(tmp_path, text, words):
    with pytest.raises(RecordingError) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert "\n" not in message
    for word in ["measured.csv", *words]:
        assert word in message
