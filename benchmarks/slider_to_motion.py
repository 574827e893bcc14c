# SPDX-License-Identifier: Apache-2.0
"""From a moved slider to the body on the page: ``python benchmarks/slider_to_motion.py``.

A slider of the live page is moved, as a browser's message does it, and the time taken to the first frame that was sent
to the page and whose body has flown with the new value: the part of this process. What a browser adds is its own
drawing. Each kind of setting is moved in turn: one of the reference, P_err, which a controller takes between steps,
and the horizon, for which another controller is built.
"""

import argparse
import json
import threading
import time

import numpy as np

from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.view.live_controls import LivePage
from skydiver_utc.view.live_flight import LiveFlight

MOVES = {
    "reference.amplitude_deg_s": (380.0, 400.0),
    "controller.P_err": (1.1e-4, 1e-4),
    "controller.horizon_steps": (21, 20),
}
WARM_S, PAUSE_S = 3.0, 0.13


class MeasuredPage(LivePage):
    """A page that remembers when its frames were sent, and with which scenario they were flown."""

    sent: tuple[float, Scenario] | None = None

    def frame(self, seconds: float) -> None:
        """A frame, with its end."""
        super().frame(seconds)
        self.server.flush()
        self.sent = time.perf_counter(), self.flight.scenario


def measure(count: int) -> dict[str, list[float]]:
    """Delays [ms] of each setting, `count` of them."""
    flight = LiveFlight(load_scenario("fast_turn_unknown_dynamics"))
    page, done = MeasuredPage(flight), threading.Event()
    thread = threading.Thread(target=page.run, args=(done.is_set,))
    thread.start()
    while page.sent is None:  # as long as it compiles
        time.sleep(0.1)
    time.sleep(WARM_S)
    delays: dict[str, list[float]] = {name: [] for name in MOVES}
    rng = np.random.default_rng(1)
    try:
        for i in range(count):
            for name, values in MOVES.items():
                time.sleep(PAUSE_S * (1.0 + rng.random()))
                before, moved_at = page.sent[1], time.perf_counter()
                page.handles[name].value = values[i % 2]  # calls what a browser's message calls
                while page.sent[1] is before:
                    time.sleep(0.0005)
                delays[name].append(1e3 * (page.sent[0] - moved_at))
    finally:
        done.set()
        thread.join()
    return delays


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    delays = measure(parser.parse_args().count)
    delays["all"] = [delay for found in delays.values() for delay in found]
    rows = {
        name: {f"p{q}_ms": round(float(np.percentile(found, q)), 1) for q in (50, 95, 99)}
        for name, found in delays.items()
    }
    print(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
