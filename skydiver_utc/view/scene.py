# SPDX-License-Identifier: Apache-2.0
"""The shapes of a plant in a viser scene."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.analysis.style import BLUE, GREEN, ORANGE, PURPLE, VERMILLION, rgb
from skydiver_utc.arrays import Array
from skydiver_utc.plants.protocol import Plant

if TYPE_CHECKING:  # it is imported only where a body is shown
    from viser import SceneApi, ViserServer

Colour = tuple[int, int, int]

# Left and right show which way a body turns.
_SIDES, _MIDDLE = {"left": rgb(BLUE), "right": rgb(ORANGE)}, (150, 158, 166)
RUNS: tuple[Colour, ...] = (rgb(BLUE), rgb(VERMILLION), rgb(GREEN), rgb(PURPLE))
_POINTS = 24  # of the unit sphere around its equator


@contextmanager
def scene_server(port: int = 0, title: str | None = None) -> "Iterator[ViserServer]":
    """A viser server on this machine's loopback only, without its own messages; port 0: any free one."""
    from viser import ViserServer

    with redirect_stdout(StringIO()):
        server = ViserServer(host="127.0.0.1", port=port, label=title, verbose=False)
    try:
        yield server
    finally:
        with redirect_stdout(StringIO()):
            server.stop()


def light(scene: "SceneApi") -> None:
    """Light a scene from all sides, brighter from above."""
    scene.configure_environment_map(None)  # without a graphics card it leaves everything white
    scene.configure_default_lights(cast_shadow=False)
    scene.add_light_hemisphere("/sky", sky_color=(255, 255, 255), ground_color=(200, 200, 210), intensity=2.0)


class PlantShapes:
    """Ellipsoids in a scene, one for each shape of a plant, drawn with one mesh; `show` moves them.

    name: of the node in the scene, beginning with a slash; colour: of all, else left, right and middle apart;
    opacity: below 1 things behind are seen; mesh: viser's handle
    """

    def __init__(
        self, scene: "SceneApi", plant: Plant, name: str, colour: Colour | None = None, opacity: float = 1.0
    ) -> None:
        vertices, faces = _sphere()
        count = len(plant.shapes)
        sides = [_SIDES.get(shape.name.partition("_")[0], _MIDDLE) for shape in plant.shapes]
        self.mesh = scene.add_batched_meshes_simple(
            name,
            vertices,
            faces,
            np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            np.zeros((count, 3)),
            batched_scales=np.array([shape.half_axes for shape in plant.shapes]),
            batched_colors=as_light([colour or side for side in sides]),
            opacity=None if opacity == 1.0 else opacity,
            lod="off",
        )

    def show(self, poses: Array, origin: Array | tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        """Draw the shapes at poses (S, 7) of the world, as `Plant.shape_poses` gives them, seen from an origin (3,)."""
        self.mesh.batched_positions = (poses[:, :3] - origin).astype(np.float32)
        self.mesh.batched_wxyzs = poses[:, [6, 3, 4, 5]].astype(np.float32)


def as_light(colours: Sequence[Colour]) -> NDArray[np.uint8]:
    """The colours (S, 3) as light: batches of meshes and arrows, other than single meshes, show them that way."""
    return np.rint(255.0 * (np.array(colours) / 255.0) ** 2.2).astype(np.uint8)


def _sphere() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Vertices (V, 3) and triangles (F, 3) of a unit sphere, by latitude and longitude."""
    rows = _POINTS // 2 + 1
    latitude = np.linspace(0.0, np.pi, rows)[:, np.newaxis]
    longitude = np.linspace(0.0, 2.0 * np.pi, _POINTS, endpoint=False)
    across = np.sin(latitude)
    axes = across * np.cos(longitude), across * np.sin(longitude), np.cos(latitude) + 0 * longitude
    vertices = np.stack(axes, axis=-1).reshape(-1, 3).astype(np.float32)
    here = np.arange((rows - 1) * _POINTS).reshape(-1, _POINTS)
    beside = np.roll(here, -1, axis=1)
    below, opposite = here + _POINTS, beside + _POINTS
    faces = [np.stack(corners, axis=-1) for corners in ((here, below, opposite), (here, opposite, beside))]
    return vertices, np.reshape(faces, (-1, 3)).astype(np.uint32)
