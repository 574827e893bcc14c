# SPDX-License-Identifier: Apache-2.0
"""The kinds of movement pattern that can be designed: what each one wants, and what it pays for."""

from collections.abc import Mapping
from dataclasses import dataclass

# Places in the six accelerations (x, y, z in m/s2, about x, y, z in rad/s2, body axes).
_X, _Y, _Z, _ROLL, _PITCH, _YAW = range(6)
# Angles of the limbs that a pattern may move: joint without its side, column.
PAIRED = (
    *(("shoulder", column) for column in range(3)),
    *(("elbow", column) for column in (0, 2)),
    *(("hip", column) for column in range(3)),
    *(("knee", column) for column in (0, 2)),
)
_TRUNK = ("lumbar", "thorax")
# Where the two sides move alike the negative is no mirror image and is judged, too.
_BOTH_WAYS = tuple((side * alpha, side) for side in (-1.0, 1.0) for alpha in (0.5, 1.0, 1.5))


@dataclass(frozen=True)
class PatternKind:
    """One kind of pattern.

    A pattern whose two sides move alike (right_side = 1) bends the trunk only forwards; one whose sides move
    against each other (-1) is mirrored by its negative and only bends the trunk sideways and twists it.

    judged holds pattern angles [rad], each with the weight of the wanted acceleration there; acceleration_costs
    weigh squared accelerations by axis, swing_costs the squared angular momentum about an axis of limbs that move at
    1 rad/s of the pattern: one that swings turns the body the wrong way whenever it starts.
    """

    name: str
    description: str
    aim: str
    wanted: int
    right_side: int
    judged: tuple[tuple[float, float], ...]
    acceleration_costs: Mapping[int, float]
    swing_costs: Mapping[int, float]

    @property
    def midline(self) -> tuple[tuple[str, int], ...]:
        """Free angles of the trunk."""
        columns = (0,) if self.right_side > 0 else (1, 2)
        return tuple((joint, column) for joint in _TRUNK for column in columns)


_KINDS = (
    PatternKind(
        name="turn",
        description="Left turn for a positive pattern angle, right turn for a negative one",
        aim=(
            "most yaw acceleration at pattern angles 0.5, 1 and 1.5 rad with roll, pitch, horizontal acceleration"
            " and swing of the limbs penalised"
        ),
        wanted=_YAW,
        right_side=-1,
        judged=((0.5, 0.6), (1.0, 0.6), (1.5, 1.8)),
        acceleration_costs={_X: 0.05, _Y: 0.03, _ROLL: 0.6, _PITCH: 1.2},
        swing_costs={_X: 0.9, _Z: 3.0},
    ),
    PatternKind(
        name="pitch",
        description="Head down for a positive pattern angle, head up for a negative one",
        aim=(
            "most pitch acceleration at pattern angles of 0.5, 1 and 1.5 rad to both sides with surge, heave and"
            " swing of the limbs penalised"
        ),
        wanted=_PITCH,
        right_side=1,
        judged=_BOTH_WAYS,
        acceleration_costs={_X: 1.0, _Z: 1.0},
        swing_costs={_Y: 0.9},
    ),
    PatternKind(
        name="lateral",
        description="Slide to the left for a positive pattern angle, to the right for a negative one",
        aim=(
            "most acceleration to the left at pattern angles 0.5, 1 and 1.5 rad with surge, heave, roll, pitch, yaw"
            " and swing of the limbs penalised"
        ),
        wanted=_Y,
        right_side=-1,
        judged=((0.5, 1.0), (1.0, 1.0), (1.5, 1.0)),
        acceleration_costs={_X: 1.0, _Z: 1.0, _ROLL: 3.0, _PITCH: 3.0, _YAW: 10.0},
        swing_costs={_X: 0.9, _Z: 3.0},
    ),
    PatternKind(
        name="fall_rate",
        description="Slower fall for a positive pattern angle, faster fall for a negative one",
        aim=(
            "most heave acceleration at pattern angles of 0.5, 1 and 1.5 rad to both sides with surge, pitch and"
            " swing of the limbs penalised"
        ),
        wanted=_Z,
        right_side=1,
        judged=_BOTH_WAYS,
        acceleration_costs={_X: 2.0, _PITCH: 4.0},
        swing_costs={_Y: 0.3},
    ),
)
PATTERN_KINDS = {kind.name: kind for kind in _KINDS}
