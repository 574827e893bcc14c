# SPDX-License-Identifier: Apache-2.0
"""The pages of a live flight and of recorded runs: what a user can change on each."""

import re
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from skydiver_utc.loop.plant_steps import states_to_push
from skydiver_utc.parameters import Leaf, ParameterError, Scenario, leaves
from skydiver_utc.view.live_page import Page
from skydiver_utc.view.recorded_flight import RecordedFlight

if TYPE_CHECKING:  # nodes are imported only where a page is of a flight over ROS
    from skydiver_utc.view.live_flight import LiveFlight
    from skydiver_utc.view.ros_flight import RosFlight

# A slider reaches so many times the scenario's value, and down to a share of it where the sign may not change.
_FACTOR, _SHARE = 5.0, 0.01
# A setting that is zero has a slider over its bounds where these are no further apart.
_WIDEST = 1000.0
_STEPS = 200


class LivePage(Page):
    """A flight with its settings, gusts, pushes and reset; handles: the controls of settings, by name."""

    def __init__(self, flight: "LiveFlight | RosFlight", port: int = 8080) -> None:
        self.flight, self.handles = flight, dict[str, Any]()
        super().__init__([flight], flight.scenario.title or flight.name, port)

    def add_controls(self) -> None:
        """Buttons, and a slider, switch or choice for each setting."""
        gui, flight, able = self.server.gui, self.flight, states_to_push(self.flight.plant)
        self.on("Reset", flight.reset, gui.add_button("Reset"), "R")
        with gui.add_folder("Gust and push"):
            if flight.gusts.settings is not None:
                self.on("Gust", flight.blow, gui.add_button("Gust"), "G")
            state = gui.add_dropdown("state", able, initial_value=able[-1])
            by = gui.add_number("change [unit of the state]", 1.0, step=0.1)
            self.on("Push", lambda: flight.push(state.value, by.value), gui.add_button("Push"), "P")
            if flight.gusts.settings is not None:
                for leaf in leaves(flight.gusts.settings):
                    if leaf.name != "start_s":
                        self._add(leaf, flight.gusts.change)
        for slot in flight.changes:
            with gui.add_folder(slot.capitalize()):
                for leaf in settings_to_change(flight.scenario):
                    if leaf.name.startswith(f"{slot}."):
                        self._add(leaf, lambda name, value: flight.change({name: value}))

    def toggle(self) -> None:
        """Play or pause; the flight too, where it can."""
        super().toggle()
        self.flight.pause(not self.playing)

    def _add(self, leaf: Leaf, change: Callable[[str, Any], None]) -> None:
        """The control that fits a setting; it changes the flight at the next frame, or goes back where refused."""
        gui, words, hint = self.server.gui, label(leaf), leaf.description or None
        value: Any = leaf.value
        if leaf.choices:
            handle: Any = gui.add_dropdown(words, leaf.choices, initial_value=value, hint=hint)
        elif isinstance(value, bool):
            handle = gui.add_checkbox(words, value, hint=hint)
        elif (span := slider_range(leaf)) is not None:
            handle = gui.add_slider(words, *span, value, hint=hint)
        else:
            handle = gui.add_number(words, value, hint=hint)
        self.handles[leaf.name] = handle
        in_force = [value]

        def apply() -> None:
            if handle.value == in_force[0]:
                return
            try:
                change(leaf.name, handle.value)
            except ParameterError:
                handle.value = in_force[0]
                raise
            in_force[0] = handle.value

        handle.on_update(lambda _: self.later(leaf.name, apply))


class RunsPage(Page):
    """Recorded runs side by side, with the time of the first one's beginning to the last one's end."""

    def __init__(self, flights: Sequence[RecordedFlight], port: int = 8080) -> None:
        self._flights = flights
        self._span = (min(each.begins_s for each in flights), max(each.ends_s for each in flights))
        super().__init__(flights, ", ".join(each.name for each in flights), port, self._span)

    def add_controls(self) -> None:
        """The time, which follows the runs and moves them."""
        begins, ends = self._span
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
        self._time.value = min(max(shown, self._span[0]), self._span[1])

    def _moved(self, event: Any) -> None:
        if event.client is not None:  # moved by a user, and not by the runs
            time_s = self._time.value
            self.later("time", lambda: self.seek(time_s))


def settings_to_change(scenario: Scenario) -> Iterator[Leaf]:
    """The settings of the reference and the controller; a row of numbers as one each, `name.0` and so on."""
    for leaf in leaves(scenario):
        if leaf.name.startswith(("reference.", "controller.")):
            if isinstance(leaf.value, tuple):
                for i, value in enumerate(leaf.value):
                    yield leaf._replace(name=f"{leaf.name}.{i}", value=value)
            else:
                yield leaf


def slider_range(leaf: Leaf) -> tuple[float, float, float] | None:
    """Ends and step of a number's slider around its value inside its bounds; None where it needs a field to type in.

    A value that may be negative by its bounds can change its sign; any other stays above a hundredth of itself.
    """
    value = float(leaf.value)  # type: ignore[arg-type]
    low = float("-inf") if leaf.minimum is None else leaf.minimum
    high = float("inf") if leaf.maximum is None else leaf.maximum
    if value == 0.0:
        if high - low > _WIDEST:
            return None
    elif value < 0.0 or (leaf.minimum is not None and leaf.minimum < 0.0):
        low, high = max(low, -_FACTOR * abs(value)), min(high, _FACTOR * abs(value))
    else:
        low, high = max(low, _SHARE * value), min(high, _FACTOR * value)
    if isinstance(leaf.value, int):
        return int(max(low, min(value, 1.0))), int(high), 1
    return low, high, (high - low) / _STEPS


def label(leaf: Leaf) -> str:
    """Name without the slot, and unit."""
    name, unit = leaf.name.split(".", 1)[-1], "" if leaf.unit == "1" else leaf.unit
    name = re.sub(f"_{re.escape(unit.replace('/', '_'))}$", "", name, flags=re.IGNORECASE)
    return name.replace("_", " ") + (f" [{unit}]" if unit else "")
