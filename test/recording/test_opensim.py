# SPDX-License-Identifier: Apache-2.0
"""Motion files of OpenSim: each segment stands as the axes of OpenSim's models say."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from refusals import assert_refused
from scipy.spatial.transform import Rotation

from skydiver_utc.body.posture import configuration, joint_angle_names
from skydiver_utc.body.segments import SEGMENTS, build_body
from skydiver_utc.errors import RecordingError
from skydiver_utc.parameters import load_scenario
from skydiver_utc.recording.joint_angles import JointAngles, read_joint_angles

Array = NDArray[np.float64]
NAMES = joint_angle_names()
# OpenSim's axes, forwards, up and right, in those of this body: to the head, to the left, dorsal.
INTO_BODY = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
FORWARDS, UP, RIGHT = np.eye(3)
# Segment without side, the one that carries it, what turns it in the models, one after the other, on the right side;
# on the left one forwards and up are reversed. The knee's sign is Rajagopal's, pro_sup counts from the palm forwards.
CHAINS = [
    ("thigh", "lower_trunk", {"hip_flexion": RIGHT, "hip_adduction": FORWARDS, "hip_rotation": UP}),
    ("shank", "thigh", {"knee_angle": -RIGHT}),
    ("foot", "shank", {"ankle_angle": RIGHT, "subtalar_angle": FORWARDS}),
    ("upper_arm", "upper_trunk", {"arm_flex": RIGHT, "arm_add": FORWARDS, "arm_rot": UP}),
    ("forearm", "upper_arm", {"elbow_flex": RIGHT, "pro_sup": UP}),
]


def motion(path: Path, degrees: dict[str, Any], unit: str = "yes") -> Path:
    """A file of OpenSim with these columns, a second between the rows."""
    columns = {"time": range(10), **degrees}
    rows = ["\t".join(map(repr, row)) for row in zip(*columns.values(), strict=False)]
    head = ["Coordinates", "version=1", f"inDegrees={unit}", "", "Angles are in degrees.", "endheader"]
    path.write_text("\n".join([*head, "\t".join(columns), *rows, ""]), encoding="utf-8")
    return path


def rotations(found: JointAngles, row: int) -> Array:
    """Segments (16, 3, 3) in the body of one posture, all other joint angles at zero."""
    angles = np.zeros(len(NAMES))
    angles[[NAMES.index(name) for name in found.names]] = found.values[row]
    body = build_body(load_scenario("bank_recovery").plant.subject)
    return configuration(body, angles.reshape(-1, 3)).rotation


@pytest.mark.parametrize(("segment", "carrier", "turns"), CHAINS, ids=[chain[0] for chain in CHAINS])
@pytest.mark.parametrize("side", ["left", "right"])
def test_each_segment_stands_as_in_the_models(
    segment: str, carrier: str, turns: dict[str, Array], side: str, tmp_path: Path
) -> None:
    degrees = dict(zip(turns, ([35.0, 10.0], [-20.0, 12.0], [15.0, -8.0]), strict=False))
    found = read_joint_angles(
        motion(tmp_path / "a.mot", {f"{name}_{side[0]}": values for name, values in degrees.items()}), NAMES
    )
    place = {
        s.name.removeprefix(f"{side}_"): i for i, s in enumerate(SEGMENTS) if s.side == 0 or side in s.name
    }
    for row in range(2):
        turned = rotations(found, row)
        expected = np.eye(3)
        for name, axis in turns.items():
            mirrored = axis if side == "right" or axis[2] else -axis
            beyond = degrees[name][row] - (90.0 if name == "pro_sup" else 0.0)
            expected = expected @ Rotation.from_rotvec(np.deg2rad(beyond) * mirrored).as_matrix()
        relative = turned[place[carrier]].T @ turned[place[segment]]
        np.testing.assert_allclose(relative, INTO_BODY @ expected @ INTO_BODY.T, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "axis"), [("lumbar_extension", RIGHT), ("lumbar_bending", FORWARDS), ("lumbar_rotation", UP)]
)
def test_the_trunk_bends_as_in_the_models_in_two_joints(name: str, axis: Array, tmp_path: Path) -> None:
    turned = rotations(read_joint_angles(motion(tmp_path / "a.sto", {name: [30.0, 0.0]}), NAMES), 0)
    for segment, share in (("mid_trunk", 0.5), ("upper_trunk", 1.0), ("left_hand", 1.0)):
        expected = Rotation.from_rotvec(share * np.deg2rad(30.0) * axis).as_matrix()
        place = [s.name for s in SEGMENTS].index(segment)
        np.testing.assert_allclose(turned[place], INTO_BODY @ expected @ INTO_BODY.T, atol=1e-12)


def test_a_hand_bends_to_its_palm_and_to_the_little_finger(tmp_path: Path) -> None:
    """In the zero pose the palm faces the thigh: flexion goes to the midline, ulnar deviation backwards."""
    columns = {"wrist_flex_r": [20.0, 0.0], "wrist_dev_r": [0.0, 20.0]}
    found = read_joint_angles(motion(tmp_path / "a.mot", columns), NAMES)
    place = [s.name for s in SEGMENTS].index("right_hand")
    fingers = [rotations(found, row)[place] @ [-1.0, 0.0, 0.0] for row in range(2)]
    s = np.sin(np.deg2rad(20.0))
    np.testing.assert_allclose([fingers[0][1], fingers[1][2]], [s, s], atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_knee_bends_whichever_sign_the_model_has(sign: float, tmp_path: Path) -> None:
    """gait2392 counts a bent knee negative, Rajagopal positive; the straight one is a degree beyond."""
    columns = {"knee_angle_r": [60.0 * sign, -1.1 * sign], "knee_angle_l": [3.0 * sign, 0.0]}
    found = read_joint_angles(motion(tmp_path / "a.mot", columns), NAMES)
    assert found.names == ("right_knee_flexion", "left_knee_flexion")
    np.testing.assert_allclose(np.rad2deg(found.values), [[60.0, 3.0], [-1.1, 0.0]])
    assert bool(found.note) == (sign < 0.0)
    straight = motion(tmp_path / "b.mot", {"knee_angle_r": [0.0, 0.0]})
    assert not read_joint_angles(straight, NAMES).note


def test_radians_paths_and_columns_that_are_no_angles(tmp_path: Path) -> None:
    columns = {
        "/jointset/hip_r/hip_flexion_r/value": [0.5, 1.0],
        "/jointset/hip_r/hip_flexion_r/speed": [700.0, float("nan")],
        "pelvis_tx": [0.0, 1.0],
    }
    found = read_joint_angles(motion(tmp_path / "A.STO", columns, "no"), NAMES)
    assert found.names == ("right_hip_flexion",)
    np.testing.assert_allclose(found.values, [[0.5], [1.0]])
    assert found.note.partition(": ")[2].split(", ") == list(columns)[1:]


GOOD = "inDegrees=yes\nendheader\ntime hip_flexion_r\n0 1\n1 20\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["inDegrees"]),
        (GOOD.replace("endheader\n", ""), ["endheader"]),
        (GOOD.replace("inDegrees=yes\n", ""), ["inDegrees"]),
        (GOOD.replace("yes", "maybe"), ["inDegrees"]),
        (GOOD.replace("yes", "no"), ["line 5, column hip_flexion_r", "1145.92"]),
        (GOOD.replace("time hip", "hip_flexion_r time"), ["line 3", "time"]),
        (GOOD.replace("hip_flexion_r", "pelvis_tx"), ["line 3", "hip_flexion_r"]),
        (GOOD.replace("hip_flexion_r", "hip_flexion_r hip_flexion_r"), ["line 3, column 3", "hip_flexion_r"]),
        (GOOD.replace("1 20", "1 2_0"), ["line 5, column hip_flexion_r", "'2_0'"]),
        ("inDegrees=yes\nendheader\n", ["line 2", "time"]),
    ],
)
def test_a_fault_is_one_sentence(text: str, words: list[str], tmp_path: Path) -> None:
    path = tmp_path / "gait.mot"
    path.write_text(text, encoding="utf-8")
    assert_refused(["gait.mot", *words], read_joint_angles, path, NAMES, kind=RecordingError)
