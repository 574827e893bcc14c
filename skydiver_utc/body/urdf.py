# SPDX-License-Identifier: Apache-2.0
"""The body as a URDF robot model, for displays and other tools.

The root link is `base_link`: origin at mid hip, axes of the pelvis. A joint of three angles is three revolute joints
in a row, with the names of `joint_angle_names`; the two links between them have no mass.
"""

import math
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.posture import ANGLES, joint_angle_names, joint_ranges, rotation_axes
from skydiver_utc.body.segments import SEGMENTS, Body, build_body, ellipsoids
from skydiver_utc.parameters.body import Subject

# A box has the mass and the moments of inertia of an ellipsoid with these half axes.
_BOX = math.sqrt(2.4)


def urdf(subject: Subject) -> str:
    """The URDF of a subject; a segment is shown as the box of its mass and inertia."""
    body, axes = build_body(subject), rotation_axes()
    lower, upper = joint_ranges(subject.joint_limits)
    names = np.array(joint_angle_names()).reshape(-1, len(ANGLES))
    robot = Element("robot", name="skydiver")
    SubElement(robot, "link", name="base_link")
    _add_segment(robot, 0, body)
    _add_joint(robot, "pelvis", "fixed", "base_link", SEGMENTS[0].name)
    for i, segment in enumerate(SEGMENTS[1:], 1):
        chain = [segment.parent, *(f"{name}_link" for name in names[i - 1, :-1]), segment.name]
        for link in chain[1:-1]:
            SubElement(robot, "link", name=link)
        _add_segment(robot, i, body)
        for angle in range(len(ANGLES)):
            joint = _add_joint(robot, names[i - 1, angle], "revolute", chain[angle], chain[angle + 1])
            SubElement(joint, "origin", xyz=_numbers(body.joint[i] if angle == 0 else np.zeros(3)))
            SubElement(joint, "axis", xyz=_numbers(axes[i - 1, angle]))
            limit = {"lower": _number(lower[i - 1, angle]), "upper": _number(upper[i - 1, angle])}
            SubElement(joint, "limit", limit | {"effort": "0", "velocity": "0"})
    indent(robot)
    return '<?xml version="1.0"?>\n' + tostring(robot, encoding="unicode") + "\n"


def _add_joint(robot: Element, name: str, kind: str, parent: str, child: str) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    return joint


def _add_segment(robot: Element, i: int, body: Body) -> None:
    link = SubElement(robot, "link", name=SEGMENTS[i].name)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_numbers(body.centre[i]))
    SubElement(inertial, "mass", value=_number(body.mass[i]))
    moments = dict(zip(("ixx", "iyy", "izz"), map(_number, body.inertia[i]), strict=True))
    SubElement(inertial, "inertia", moments | dict.fromkeys(("ixy", "ixz", "iyz"), "0"))
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz=_numbers(body.centre[i]))
    SubElement(SubElement(visual, "geometry"), "box", size=_numbers(_BOX * ellipsoids(body)[i]))


def _numbers(values: Array) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    """All digits: the model is that of `body/` to rounding errors."""
    return repr(float(value) + 0.0)
