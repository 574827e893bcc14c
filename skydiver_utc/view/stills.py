# SPDX-License-Identifier: Apache-2.0
"""Key moments of a run, and a drawing of a plant's shapes at each."""

from typing import NamedTuple

import numpy as np

from skydiver_utc.analysis.metrics import convergence_time
from skydiver_utc.analysis.numbers import row_from, settled
from skydiver_utc.arrays import Array
from skydiver_utc.loop.run import Run
from skydiver_utc.plants.protocol import Plant

# From where a body is seen, and the right and upper direction of a picture from there.
EYE = np.array([0.62, -0.64, 0.45]) / np.linalg.norm([0.62, -0.64, 0.45])
RIGHT = np.cross([0.0, 0.0, 1.0], EYE) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], EYE))
_PICTURE = np.stack([RIGHT, np.cross(EYE, RIGHT)])
_MOST, _APART = 6, 0.03  # moments, and their least distance as a share of the run


class Moment(NamedTuple):
    """A row of a run's states, and what is to be seen there."""

    row: int
    words: str


def moments(run: Run) -> list[Moment]:
    """At most six moments in the order of time, beginning and end among them."""
    found = [Moment(0, "start"), Moment(len(run.states) - 1, "end")]
    rows = np.flatnonzero(settled(run))
    for j, name in enumerate(run.tracked_names):
        if run.error is None or not len(rows):
            continue
        words, values = name.replace("_", " "), run.output(name)[rows]
        found.append(Moment(int(rows[np.abs(run.error[rows, j]).argmax()]), f"largest error of {words}"))
        if (time_s := convergence_time(run, j)) is not None:
            found.append(Moment(row_from(time_s, run), f"{words} inside 5 %"))
        found += [Moment(int(rows[values.argmax()]), f"largest {words}")]
        found += [Moment(int(rows[values.argmin()]), f"smallest {words}")]
    kept: list[Moment] = []
    for one in found:
        if all(abs(one.row - other.row) > _APART * len(run.states) for other in kept) and len(kept) < _MOST:
            kept.append(one)
    return sorted(kept)


def drawing(plant: Plant, poses: Array, colours: list[str]) -> str:
    """The shapes at poses (S, 7) as SVG, as seen from `EYE` at a great distance; class names for their colours."""
    from scipy.spatial.transform import Rotation

    centres = poses[:, :3] - poses[:, :3].mean(axis=0)
    half_axes = np.array([shape.half_axes for shape in plant.shapes])
    axes = Rotation.from_quat(poses[:, 3:]).as_matrix() * half_axes[:, np.newaxis]
    flat = _PICTURE @ axes  # (S, 2, 3): an ellipsoid is seen as the ellipse of flat flat'
    places = centres @ _PICTURE.T
    reach = 1.05 * float(np.max(np.linalg.norm(centres, axis=1) + half_axes.max(axis=1)))
    return "".join(
        [
            f'<svg viewBox="{-reach:.3f} {-reach:.3f} {2 * reach:.3f} {2 * reach:.3f}" aria-hidden="true">',
            *(_ellipse(places[i], flat[i], colours[i]) for i in np.argsort(centres @ EYE)),
            "</svg>",
        ]
    )


def _ellipse(place: Array, flat: Array, colour: str) -> str:
    (small, large), directions = np.linalg.eigh(flat @ flat.T)
    turned = np.degrees(np.arctan2(directions[1, 1], directions[0, 1]))
    return (
        f'<ellipse class="{colour}" rx="{large**0.5:.3f}" ry="{max(small, 0.0) ** 0.5:.3f}"'
        f' transform="translate({place[0]:.3f} {-place[1]:.3f}) rotate({-turned:.1f})"/>'
    )
