# SPDX-License-Identifier: Apache-2.0
"""One flight in a viser page: its body, forces, wind, path and ghost, and its charts."""

from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from skydiver_utc.analysis.style import GREEN, PINK, SKY, VERMILLION, rgb
from skydiver_utc.arrays import Array
from skydiver_utc.plants.protocol import FORCE_M_PER_N
from skydiver_utc.view.charts import Chart, Instant, add_chart, chart_data
from skydiver_utc.view.scene import PlantShapes, as_light

# viser is imported only where a page is shown, nodes only where one is of a flight over ROS.
if TYPE_CHECKING:
    from viser import ViserServer

    from skydiver_utc.view.live_flight import LiveFlight
    from skydiver_utc.view.recorded_flight import RecordedFlight
    from skydiver_utc.view.ros_flight import RosFlight

    Flight = LiveFlight | RosFlight | RecordedFlight

_GHOST, _FORCE, _WIND, _PATH = rgb(SKY), rgb(VERMILLION), rgb(GREEN), rgb(PINK)
_M_PER_M_S = 0.1  # of the arrow of a wind
_PATH_S = 10.0  # how far the path looks back
_JUMP_M = 2.0  # beyond twice its way at the present speed a body was put elsewhere
_WIND_FROM = np.array([0.0, 0.0, 0.8])


class FlightView:
    """Draws a flight at a place (3,) of the scene; a body whose state is an odometry stays there as it falls.

    options: whether each of `PARTS` is drawn, and how far the ghost looks "ahead" [s], at least to the horizon
    """

    PARTS = ("ghost", "forces", "wind", "path")

    def __init__(
        self, server: "ViserServer", flight: "Flight", node: str, place: Array, options: Mapping[str, Any]
    ) -> None:
        self.flight, self._options = flight, options
        self._place, self._follows = place, flight.plant.state_message == "odometry"
        self._path: deque[tuple[float, Array]] = deque()
        self._charts: list[tuple[Chart, Any]] = []
        self._server = server
        scene, nothing, arrows = server.scene, np.zeros((0, 2, 3)), as_light([_FORCE, _WIND])
        self._body = self._ghost = None
        if flight.plant.shapes:
            self._body = PlantShapes(scene, flight.plant, f"{node}/body")
            self._ghost = PlantShapes(scene, flight.plant, f"{node}/ghost", colour=_GHOST, opacity=0.35)
        self._spread = scene.add_point_cloud(
            f"{node}/spread", np.zeros((0, 3)), colors=_GHOST, point_size=0.02
        )
        self._forces = scene.add_arrows(
            f"{node}/forces", nothing, arrows[0], shaft_radius=0.008, head_radius=0.02, head_length=0.05
        )
        self._wind = scene.add_arrows(f"{node}/wind", nothing, arrows[1])
        self._line = scene.add_line_segments(f"{node}/path", nothing, colors=_PATH, thickness=0.015)

    def add_charts(self, span: tuple[float, float] | None = None) -> None:
        """Add the charts to the part of the page that is open."""
        self._charts = [
            (chart, add_chart(self._server.gui, chart, span)) for chart in self.flight.signals.charts()
        ]

    def show(self) -> Instant:
        """Draw the present instant, but for charts and ghost."""
        now, plant = self.flight.now(), self.flight.plant
        if self._body is not None and np.isfinite(now.state).all():
            poses = plant.shape_poses(now.state, now.applied)
            self._origin = (now.state[:3] if self._follows else np.zeros(3)) - self._place
            self._body.show(poses, self._origin)
            position = now.state[:3] if self._follows else poses[0, :3]
            speed = float(np.linalg.norm(now.state[7:10])) if self._follows else np.inf
            self._draw_path(now.time_s, position, speed)
            forces = (
                plant.shape_forces(now.state, now.applied) if self._options["forces"] else np.empty((0, 3))
            )
            tails = poses[: len(forces), :3] - self._origin
            self._forces.points = _segments(tails, tails + FORCE_M_PER_N * forces)
            blows = self._options["wind"] and now.wind.any()
            tail = (self._place + _WIND_FROM)[np.newaxis]
            self._wind.points = _segments(tail, tail + _M_PER_M_S * now.wind)[: int(blows)]
        return now

    def show_ahead(self) -> None:
        """Draw the charts, and the ghost with the spread of the sigma points."""
        states, applied = self.flight.look_ahead(self._options["ahead"])
        self._draw_ghost(states, applied)
        rows = self.flight.history()
        if len(rows) < 2:
            return
        time_s, outputs = rows[-1:, 0], np.empty((0, 1, 1))
        if len(states) and np.isfinite(states[0]).all():
            outputs = self.flight.signals.outputs(states)
            ahead_s: Array = self.flight.plant.dt_s * np.arange(states.shape[1], dtype=np.float64)
            time_s = self.flight.now().time_s + ahead_s
        for chart, handle in self._charts:
            handle.data = chart_data(chart, rows, time_s, outputs)

    def _draw_ghost(self, states: Array, applied: Array) -> None:
        """The shapes at the end of predicted states (S, J + 1, n): a ghost, and points under the sigma points.

        Of a body that falls without the way that it takes at its present velocity.
        """
        if self._ghost is None:
            return
        drawn = self._options["ghost"] and len(states) > 0 and bool(np.isfinite(states[0, -1]).all())
        self._ghost.mesh.visible = self._spread.visible = drawn
        if not drawn:
            return
        plant, ends, origin = self.flight.plant, states[:, -1], self._origin
        if self._follows:
            origin = origin + (states.shape[1] - 1) * (states[0, 1, :3] - states[0, 0, :3])
        self._ghost.show(plant.shape_poses(ends[0], applied[0]), origin)
        points = [
            plant.shape_poses(state, held)[:, :3] - origin
            for state, held in zip(ends[1:], applied[1:], strict=True)
            if np.isfinite(state).all()
        ]
        self._spread.points = np.concatenate([np.empty((0, 3)), *points]).astype(np.float32)

    def _draw_path(self, time_s: float, position: Array, speed: float) -> None:
        """The last positions, as seen by somebody who falls as fast as the body did in their mean.

        A reset begins another path.
        """
        path = self._path
        if path:
            since_s = time_s - path[-1][0]
            if since_s < 0.0 or np.linalg.norm(position - path[-1][1]) > _JUMP_M + 2.0 * speed * since_s:
                path.clear()
        if not path or time_s > path[-1][0] + 0.02:
            path.append((time_s, position.copy()))
        while path and time_s - path[0][0] > _PATH_S:
            path.popleft()
        if not self._options["path"] or len(path) < 2:
            self._line.points = np.zeros((0, 2, 3), dtype=np.float32)
            return
        times = np.array([t for t, _ in path])
        seen = np.array([p for _, p in path]) - self._origin
        if self._follows:
            fall = (position[2] - path[0][1][2]) / (time_s - times[0])
            seen[:, 2] += fall * (time_s - times)
        self._line.points = _segments(seen[:-1], seen[1:])


def _segments(begins: Array, ends: Array) -> Any:
    """Segments (N, 2, 3) from points (N, 3) to points (N, 3)."""
    return np.stack([begins, ends], axis=1).astype(np.float32)
