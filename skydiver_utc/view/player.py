# SPDX-License-Identifier: Apache-2.0
"""The bodies of runs as a page that plays, with nothing outside of it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.loop.run import Run
from skydiver_utc.view.scene import Colour, PlantShapes, light, scene_server
from skydiver_utc.view.signals import posed
from skydiver_utc.view.stills import EYE, RIGHT

Floats = NDArray[np.float64]
_MOST_FRAMES, _FRAMES_PER_S = 600, 30.0
_SIZES_APART = 1.6  # of bodies side by side
_FAR = 5.0  # sizes: the view follows bodies that go farther


def player_page(runs: Sequence[Run], colours: Sequence[Colour | None]) -> str:
    """HTML of the runs' shapes side by side, from the time at which the earliest begins; for an iframe's srcdoc.

    Each state is shown with the control that acts from it on. A run that ends earlier stays at its last state.
    """
    begin, end = min(run.time_s[0] for run in runs), max(run.time_s[-1] for run in runs)
    frames = int(np.clip(np.ceil((end - begin) * _FRAMES_PER_S), 1, _MOST_FRAMES))
    times = np.linspace(begin, end, frames + 1)
    poses = [poses_at(run, times) for run in runs]
    size = max(float(np.ptp(found[0, :, :3], axis=0).max()) for found in poses) or 1.0
    with scene_server() as server:
        light(server.scene)
        server.initial_camera.look_at = np.zeros(3)
        server.initial_camera.position = EYE * size * (0.6 + 1.1 * len(runs))
        server.scene.add_grid("/level", width=20 * size, height=20 * size, cell_size=size, section_size=5 * size,
                              position=(0.0, 0.0, -1.2 * size), fade_distance=9 * size)  # fmt: skip
        bodies = [
            PlantShapes(server.scene, run.plant, f"/run_{i}", colour)
            for i, (run, colour) in enumerate(zip(runs, colours, strict=True))
        ]
        recording = server.get_scene_serializer()
        aside = [_SIZES_APART * size * (i - 0.5 * (len(runs) - 1)) * RIGHT for i in range(len(runs))]
        origins = [_origins(found, size) - place for found, place in zip(poses, aside, strict=True)]
        for k in range(len(times)):
            for body, found, origin in zip(bodies, poses, origins, strict=True):
                body.show(found[k], origin[k])
            recording.insert_sleep(float(end - begin) / frames)
        return str(recording.as_html())


def poses_at(run: Run, times_s: Floats) -> Floats:
    """Poses (T, S, 7) of the plant's shapes at the states nearest before these times."""
    rows = np.clip(np.searchsorted(run.time_s, times_s + 1e-9, side="right") - 1, 0, len(run.applied) - 1)
    whole = np.flatnonzero(_drawable(run))
    rows = whole[np.clip(np.searchsorted(whole, rows, side="right") - 1, 0, None)]
    return np.array([run.plant.shape_poses(run.states[row], run.applied[row]) for row in rows])


def has_bodies(run: Run) -> bool:
    """Whether there is a state with shapes to be drawn."""
    return bool(run.plant.shapes) and bool(_drawable(run).any())


def _drawable(run: Run) -> NDArray[np.bool_]:
    """The steps (K,) whose state and control are known."""
    drawable: NDArray[np.bool_] = posed(run)[:-1] & np.isfinite(run.applied).all(axis=1)
    return drawable


def _origins(poses: Floats, size: float) -> Floats:
    """Where the view is from, (T, 3): on the shapes' middle where they travel far, else on their first one."""
    middle: Floats = poses[:, :, :3].mean(axis=1)
    far = float(np.ptp(middle, axis=0).max()) > _FAR * size
    return middle if far else np.tile(middle[0], (len(middle), 1))
