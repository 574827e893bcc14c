# SPDX-License-Identifier: Apache-2.0
"""A film of a run: the body as it turns, drawn from the plant's shapes, and the tracked rate below.

`python examples/film.py docs/figures/skydiver.gif` films the paper's fast turn.
"""

import sys
from pathlib import Path

import matplotlib
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial.transform import Rotation

from skydiver_utc import load_scenario, simulate

matplotlib.use("Agg")
from matplotlib import animation, pyplot

RATE_HZ = 15
BODY, REFERENCE = np.array([0.0, 0.45, 0.70]), "#e69f00"
LIGHT = np.array([0.3, -0.4, 0.87])


def ellipsoid(columns=14, rows=9):
    """Faces (F, 4, 3) of the unit sphere."""
    around, down = np.meshgrid(np.linspace(0, 2 * np.pi, columns), np.linspace(0, np.pi, rows))
    p = np.stack([np.cos(down), np.sin(down) * np.cos(around), np.sin(down) * np.sin(around)], axis=-1)
    return np.stack([p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]], axis=2).reshape(-1, 4, 3)


def body(plant, state, applied):
    """Faces of all shapes about the centre of mass, with the world's axes, and how bright each is."""
    sphere = ellipsoid()
    faces, normals = [], []
    for shape, pose in zip(plant.shapes, plant.shape_poses(state, applied), strict=True):
        turned = Rotation.from_quat(pose[3:]).as_matrix().T
        faces.append(sphere * shape.half_axes @ turned + pose[:3] - state[:3])
        normals.append(sphere.mean(axis=1) / shape.half_axes @ turned)
    normal = np.concatenate(normals)
    bright = 0.45 + 0.55 * np.clip(normal @ LIGHT / np.linalg.norm(normal, axis=1), 0.0, 1.0)
    return np.concatenate(faces), bright[:, None]


def film(path):
    """Fly, and write the film."""
    run = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 5.0}))
    steps = np.arange(0, len(run.applied), round(1.0 / (RATE_HZ * run.scenario.dt_s)))
    tracked = run.plant.output_names.index(run.tracked_names[0])
    rate, wanted = np.rad2deg(run.plant.outputs(run.states)[:, tracked]), np.rad2deg(run.reference[:, 0])
    figure = pyplot.figure(figsize=(4.4, 4.6), dpi=80)
    space = figure.add_axes((0.0, 0.26, 1.0, 0.74), projection="3d", computed_zorder=False)
    chart = figure.add_axes((0.16, 0.11, 0.8, 0.2))
    chart.plot(run.time_s, wanted, color=REFERENCE, linewidth=2, label="reference")
    chart.plot(run.time_s, rate, color=BODY, linewidth=1, label=run.tracked_names[0].replace("_", " "))
    chart.set(xlabel="time [s]", ylabel="deg/s", xlim=(0, run.time_s[-1]))
    chart.legend(loc="upper right", fontsize=7, ncols=2)
    now = chart.axvline(0.0, color="0.3")
    wind = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 3)) * [1.5, 1.5, 1.2]

    def draw(k):
        space.clear()
        space.set_axis_off()
        space.set(xlim=(-0.85, 0.85), ylim=(-0.85, 0.85), zlim=(-0.7, 0.7))
        space.set_box_aspect((1.0, 1.0, 0.82), zoom=1.38)
        space.view_init(elev=32, azim=-60)
        risen = (wind[:, 2] + 3.0 * run.time_s[k] + 1.2) % 2.4 - 1.2
        for (x, y, _), z in zip(wind, risen, strict=True):
            space.plot([x, x], [y, y], [z, z + 0.15], color="0.8", linewidth=0.8)
        faces, bright = body(run.plant, run.states[k], run.applied[k])
        colours = np.clip(bright * (BODY + 0.12), 0.0, 1.0)
        space.add_collection3d(
            Poly3DCollection(faces, facecolors=colours, edgecolors=colours, linewidths=0.3)
        )
        now.set_xdata([run.time_s[k]] * 2)

    animation.FuncAnimation(figure, draw, steps, cache_frame_data=False).save(
        path, animation.PillowWriter(fps=RATE_HZ)
    )


if __name__ == "__main__":
    film(Path(sys.argv[1]))
