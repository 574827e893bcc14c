# SPDX-License-Identifier: Apache-2.0
"""The page of one or several flights, served to the browsers of this machine: play, charts, 3-D."""

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np

from skydiver_utc.parameters import ParameterError
from skydiver_utc.view.flight_view import FlightView
from skydiver_utc.view.scene import light, scene_server

if TYPE_CHECKING:
    from skydiver_utc.view.flight_view import Flight

_FRAME_S, _FRAMES_OF_CHARTS = 1.0 / 30.0, 3
# A page that was held up goes on from where it was, instead of catching up with the clock.
_LONGEST_FRAME_S = 0.1
_BESIDE_M = 2.4
_SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")


class Page:
    """Flights side by side, played at one speed; a subclass adds what a user can change.

    flights: at least one; title: above the controls; span [s]: of the charts' time axis, None: as it comes
    options: of the drawing, see `FlightView`, and the "speed"
    """

    def __init__(
        self, flights: "Sequence[Flight]", title: str, port: int, span: tuple[float, float] | None = None
    ) -> None:
        self._open = ExitStack()
        self.server = self._open.enter_context(scene_server(port, title))
        self.playing, self.frames = True, 0
        self.options: dict[str, Any] = {"speed": "1", "ahead": 0.0, **dict.fromkeys(FlightView.PARTS, True)}
        self._pending = dict[str, Callable[[], None]]()
        self._shown_at = time.perf_counter()
        self._prepare_scene(len(flights))
        middle = 0.5 * (len(flights) - 1)
        self.views = [
            FlightView(
                self.server, flight, f"/{i}", np.array([0.0, (middle - i) * _BESIDE_M, 0.0]), self.options
            )
            for i, flight in enumerate(flights)
        ]
        gui = self.server.gui
        self._set_dark(False)
        alone = len(flights) == 1
        self._lines: list[Any] = [
            gui.add_text("time" if alone else view.flight.name, "", disabled=True) for view in self.views
        ]
        self._play = gui.add_button("Pause")
        self.on("Play or pause", self.toggle, self._play, "space")
        self._sets_option("speed", gui.add_dropdown("speed", _SPEEDS, initial_value="1"))
        self.add_controls()
        self._add_what_is_shown()
        gui.main_panel.dock_right()
        charts = gui.add_panel()
        charts.dock_left()
        charts.set_width(420)
        for view in self.views:
            with charts.add_tab(view.flight.name):
                view.add_charts(span)

    @property
    def address(self) -> str:
        """The page's address for browsers of this machine."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def add_controls(self) -> None:
        """Add to the page what a user can change."""

    def on(self, words: str, act: Callable[[], None], button: Any, hotkey: Any) -> None:
        """Act at the next frame after a click on a button, or after a key."""
        button.on_click(lambda _: self.later(words, act))
        self.server.gui.add_command(words, hotkey=hotkey).on_trigger(lambda _: self.later(words, act))

    def _sets_option(self, name: str, control: Any) -> None:
        """Set an option to a control's value at the next frame after a change."""
        control.on_update(lambda _: self.later(name, lambda: self.options.update({name: control.value})))

    def later(self, name: str, act: Callable[[], None]) -> None:
        """Act at the next frame; of several under one name only the newest. Called from the server's threads."""
        self._pending[name] = act

    def toggle(self) -> None:
        """Play or pause."""
        self.playing = not self.playing
        self._play.label = "Pause" if self.playing else "Play"

    def frame(self, seconds: float) -> None:
        """One frame, so much time after the last one: what users did, the flights, the drawing.

        While nothing changes nothing is drawn.
        """
        acted = self._act()
        if not (self.playing or acted):
            return
        with self.server.atomic():
            for view, line in zip(self.views, self._lines, strict=True):
                if self.playing:
                    view.flight.advance(float(self.options["speed"]) * seconds)
                now = view.show()
                line.value = f"{now.time_s:.1f} s" + (f": {view.flight.ended}" if view.flight.ended else "")
        if acted or self.frames % _FRAMES_OF_CHARTS == 0:
            for view in self.views:
                view.show_ahead()
        self.frames += 1

    def _act(self) -> bool:
        """Do what users asked for since the last frame; False if that is nothing."""
        names = list(self._pending)  # at once: threads of the server add to it
        for name in names:
            try:
                self._pending.pop(name)()
            except ParameterError as error:
                for client in self.server.get_clients().values():
                    client.add_notification("Not changed", str(error), color="red", auto_close_seconds=8.0)
        return bool(names)

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Serve the page, frame by frame, until interrupted."""
        try:
            while not until():
                began = time.perf_counter()
                self.frame(min(began - self._shown_at, _LONGEST_FRAME_S))
                self._shown_at = began
                time.sleep(max(0.0, _FRAME_S - (time.perf_counter() - began)))
        finally:
            self.stop()

    def stop(self) -> None:
        """Stop the server."""
        self._open.close()

    def _prepare_scene(self, count: int) -> None:
        scene = self.server.scene
        light(scene)
        scene.add_grid("/ground", 6.0, 3.0 + _BESIDE_M * count, cell_size=0.5, position=(0.0, 0.0, -1.2))
        camera = self.server.initial_camera
        camera.position, camera.look_at = (-2.0, -1.8 - 0.5 * _BESIDE_M * (count - 1), 1.7), (0.0, 0.0, 0.0)

    def _add_what_is_shown(self) -> None:
        """Switches for the parts of the drawing, and the ghost's reach."""
        gui = self.server.gui
        with gui.add_folder("View", expand_by_default=False):
            for part in FlightView.PARTS:
                self._sets_option(part, gui.add_checkbox(part, True))
            ahead = gui.add_slider("ghost ahead [s]", 0.0, 1.0, 0.05, 0.0, hint="0: the controller's horizon")
            self._sets_option("ahead", ahead)
            dark = gui.add_checkbox("dark", False)
            dark.on_update(lambda _: self.later("dark", lambda: self._set_dark(dark.value)))

    def _set_dark(self, dark: bool) -> None:
        self.server.gui.configure_theme(
            show_logo=False, show_share_button=False, control_width="medium", dark_mode=dark
        )
