# SPDX-License-Identifier: Apache-2.0
"""The pages of a live flight and of recorded runs: what a user can change on each."""

from collections.abc import Sequence
from typing import Any

from skydiver_utc.parameters import Leaf, leaves
from skydiver_utc.view.live_flight import LiveFlight
from skydiver_utc.view.live_page import Page
from skydiver_utc.view.live_settings import label, settings_to_change, slider_range
from skydiver_utc.view.recorded_flight import RecordedFlight


class LivePage(Page):
    """A flight with its settings, gusts, pushes and a new beginning; handles: the controls of settings, by name."""

    def __init__(self, flight: LiveFlight, port: int = 8080) -> None:
        self.flight, self.handles = flight, dict[str, Any]()
        super().__init__([flight], flight.scenario.title or flight.name, port)

    def add_controls(self) -> None:
        """Buttons, and a slider, switch or choice for each setting."""
        gui, flight = self.server.gui, self.flight
        self.on("Reset", flight.reset, gui.add_button("Reset"), "R")
        with gui.add_folder("Gust and push"):
            if flight.gust is not None:
                self.on("Gust", flight.blow, gui.add_button("Gust"), "G")
            state = gui.add_dropdown("state", self._pushed(), initial_value=self._pushed()[-1])
            by = gui.add_number("change [unit of the state]", 1.0, step=0.1)
            self.on("Push", lambda: flight.push(state.value, by.value), gui.add_button("Push"), "P")
            if flight.gust is not None:
                for leaf in leaves(flight.gust):
                    if leaf.name != "start_s":
                        self._add(leaf, lambda name, value: self._change_gust(name, value))
        for slot in ("reference", "controller"):
            with gui.add_folder(slot.capitalize()):
                for leaf in settings_to_change(flight.scenario):
                    if leaf.name.startswith(f"{slot}."):
                        self._add(leaf, lambda name, value: flight.change({name: value}))

    def _pushed(self) -> tuple[str, ...]:
        """States that can be pushed: an attitude cannot."""
        names = self.flight.plant.state_names
        return names[7:] if self.flight.plant.state_message == "odometry" else names

    def _change_gust(self, name: str, value: Any) -> None:
        assert self.flight.gust is not None
        self.flight.gust = self.flight.gust.replace(**{name: value})

    def _add(self, leaf: Leaf, change: Any) -> None:
        """The control that fits a setting; it changes the flight at the next frame."""
        gui, words, hint = self.server.gui, label(leaf), leaf.description or None
        value: Any = leaf.value
        if leaf.choices:
            handle: Any = gui.add_dropdown(words, leaf.choices, initial_value=value, hint=hint)
        elif leaf.kind == "bool":
            handle = gui.add_checkbox(words, value, hint=hint)
        elif (span := slider_range(leaf)) is not None:
            handle = gui.add_slider(words, *span, value, hint=hint)
        else:
            handle = gui.add_number(words, value, hint=hint)
        self.handles[leaf.name] = handle
        handle.on_update(lambda _: self.later(leaf.name, lambda: change(leaf.name, handle.value)))


class RunsPage(Page):
    """Recorded runs side by side, with the time of the first one's beginning to the last one's end."""

    def __init__(self, flights: Sequence[RecordedFlight], port: int = 8080) -> None:
        self._flights = flights
        self.span = (min(each.begins_s for each in flights), max(each.ends_s for each in flights))
        super().__init__(flights, ", ".join(each.name for each in flights), port, self.span)

    def add_controls(self) -> None:
        """The time, which follows the runs and moves them."""
        begins, ends = self.span
        self._time: Any = self.server.gui.add_slider("time [s]", begins, ends, 0.01, begins)
        self._time.on_update(self._moved)
        back = self.server.gui.add_button("Begin again")
        self.on("Begin again", lambda: self.seek(begins), back, "R")

    def seek(self, time_s: float) -> None:
        """Show all runs at a time."""
        for each in self._flights:
            each.seek(time_s)

    def frame(self, seconds: float) -> None:
        """A frame, after which the slider stands at the time shown."""
        super().frame(seconds)
        shown = max(each.now().time_s for each in self._flights)
        self._time.value = min(max(shown, self.span[0]), self.span[1])

    def _moved(self, event: Any) -> None:
        if event.client is not None:  # moved by a user, and not by the runs
            time_s = self._time.value
            self.later("time", lambda: self.seek(time_s))
