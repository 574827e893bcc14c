# SPDX-License-Identifier: Apache-2.0
"""The bodies of runs as a page that plays, with nothing outside of it."""

from collections.abc import Sequence

import numpy as np

from skydiver_utc.arrays import Array, Flags
from skydiver_utc.loop.run import Run
from skydiver_utc.view.scene import Colour, PlantShapes, light, scene_server
from skydiver_utc.view.signals import posed
from skydiver_utc.view.stills import EYE, RIGHT

_MOST_FRAMES, _FRAMES_PER_S = 600, 30.0
_SIZES_APART = 1.1  # of bodies side by side
_FAR = 5.0  # sizes: the view follows bodies that go farther


def player_page(runs: Sequence[Run], colours: Sequence[Colour | None]) -> str:
    """HTML of the runs' shapes side by side, from the time at which the earliest begins; for an iframe's srcdoc.

    Each state is shown with the control that acts from it on. A run that ends earlier stays at its last state.
    """
    begin, end = min(run.time_s[0] for run in runs), max(run.time_s[-1] for run in runs)
    frames = int(np.clip(np.ceil((end - begin) * _FRAMES_PER_S), 1, _MOST_FRAMES))
    times = np.linspace(begin, end, frames + 1)
    poses = [poses_at(run, times) for run in runs]
    seen = [_seen_from(run, found) for run, found in zip(runs, poses, strict=True)]
    size = max(reach for _, reach in seen)
    with scene_server() as server:
        light(server.scene)
        server.initial_camera.look_at = np.zeros(3)
        server.initial_camera.position = EYE * size * (0.5 + 0.8 * len(runs))
        server.scene.add_grid("/level", width=20 * size, height=20 * size, cell_size=size, section_size=5 * size,
                              position=(0.0, 0.0, -1.2 * size), fade_distance=9 * size)  # fmt: skip
        bodies = [
            PlantShapes(server.scene, run.plant, f"/run_{i}", colour)
            for i, (run, colour) in enumerate(zip(runs, colours, strict=True))
        ]
        recording = server.get_scene_serializer()
        aside = [_SIZES_APART * size * (i - 0.5 * (len(runs) - 1)) * RIGHT for i in range(len(runs))]
        origins = [origin - place for (origin, _), place in zip(seen, aside, strict=True)]
        for k in range(len(times)):
            for body, found, origin in zip(bodies, poses, origins, strict=True):
                body.show(found[k], origin[k])
            recording.insert_sleep(float(end - begin) / frames)
        return str(recording.as_html())


def poses_at(run: Run, times_s: Array) -> Array:
    """Poses (T, S, 7) of the plant's shapes at the states nearest before these times."""
    rows = np.clip(np.searchsorted(run.time_s, times_s + 1e-9, side="right") - 1, 0, len(run.applied) - 1)
    whole = np.flatnonzero(_drawable(run))
    rows = whole[np.clip(np.searchsorted(whole, rows, side="right") - 1, 0, None)]
    return np.array([run.plant.shape_poses(run.states[row], run.applied[row]) for row in rows])


def has_bodies(run: Run) -> bool:
    """Whether there is a state with shapes to be drawn."""
    return bool(run.plant.shapes) and bool(_drawable(run).any())


def _drawable(run: Run) -> Flags:
    """The steps (K,) whose state and control are known."""
    return posed(run)[:-1] & np.isfinite(run.applied).all(axis=1)


def _seen_from(run: Run, poses: Array) -> tuple[Array, float]:
    """Where the view is from, (T, 3), and the width of what it sees.

    It follows the shapes' middle where they travel far, else it stays at their first one.
    """
    half = np.array([max(shape.half_axes) for shape in run.plant.shapes])
    middle: Array = poses[:, :, :3].mean(axis=1)

    def width(origin: Array, rows: slice) -> float:
        distances = np.linalg.norm(poses[rows, :, :3] - origin[rows, np.newaxis], axis=2)
        return 2.0 * float(np.max(distances + half))

    far = float(np.ptp(middle, axis=0).max()) > _FAR * width(middle, slice(1))
    origin = middle if far else np.tile(middle[0], (len(middle), 1))
    return origin, width(origin, slice(None))
