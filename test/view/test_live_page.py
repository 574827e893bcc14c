# SPDX-License-Identifier: Apache-2.0
"""The page of a flight in a browser: it draws, changes as users ask, and makes no request to another machine."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from command_line import invoke

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario, override
from skydiver_utc.view.live_controls import LivePage, RunsPage
from skydiver_utc.view.live_flight import LiveFlight
from skydiver_utc.view.live_page import Page
from skydiver_utc.view.recorded_flight import RecordedFlight

pytest_plugins = ("browser",)
pytestmark = pytest.mark.long
SCRIPT = "<img src=x onerror=alert(1)><script>alert(1)</script>"
LOAD_MS = 120_000
SMALL = {"width": 1100, "height": 640}
SCENE = "canvas[data-engine^='three.js']"


@contextmanager
def served(page: Page) -> Iterator[Page]:
    """Frame by frame, in a thread of its own."""
    done = threading.Event()
    thread = threading.Thread(target=page.run, args=(done.is_set,))
    thread.start()
    try:
        yield page
    finally:
        done.set()
        thread.join()


def opened(open_page, page: Page, **options):
    """The page in a browser, loaded and drawn."""
    # A page that stands still is drawn once: without a graphics card a moving one is hardly caught.
    page.playing = False
    shown = open_page(page.address, **(SMALL | options))
    shown.page.set_default_timeout(LOAD_MS)
    shown.page.wait_for_selector(SCENE)
    shown.page.wait_for_selector(".u-title", state="attached")
    page.later("draw", lambda: None)
    wait(shown, lambda: shown.colours(SCENE) > 50)
    if options.get("width", SMALL["width"]) >= SMALL["width"]:  # else the charts are folded
        assert shown.colours(".uplot >> nth=0") > 10
    page.later("play", page.toggle)
    return shown


def wait(shown, condition) -> None:
    """Until a condition holds, which a test of the same page asserts within two minutes."""
    for _ in range(LOAD_MS // 100):
        if condition():
            return
        shown.page.wait_for_timeout(100)
    raise AssertionError("the condition did not come true")


def test_a_live_flight_is_drawn_and_changed(open_page):
    flight = LiveFlight(load_scenario("fast_turn_unknown_dynamics", {"title": SCRIPT, "name": SCRIPT}))
    flight.advance(1.0)
    with served(LivePage(flight, port=8190)) as page:
        shown = opened(open_page, page)
        browser = shown.page
        # The gust of a click turns the body otherwise than the same flight turns without it.
        browser.get_by_role("button", name="Gust", exact=True).click()
        wait(shown, lambda: np.linalg.norm(flight.now().wind) > 1.0)
        begun = flight.now().time_s
        wait(shown, lambda: flight.now().time_s > begun + 1.0)
        page.later("stop", page.toggle)
        wait(shown, lambda: not page.playing)
        blown, still = flight.now(), LiveFlight(flight.scenario)
        still.advance(blown.time_s - 0.5 * flight.scenario.dt_s)
        assert still.now().time_s == blown.time_s
        actual = next(curve.column for curve in flight.signals.charts()[0].curves if curve.label == "actual")
        (time_s, rates), (times_s, straight) = (each.history()[:, [0, actual]].T for each in (flight, still))
        np.testing.assert_array_equal(time_s, times_s)
        assert np.abs(rates - straight).max() > 0.5  # deg/s
        # The path of the last seconds is a line, and hides nothing.
        is_of_path = np.abs(shown.pixels(SCENE).astype(int) - (204, 121, 167)).max(axis=2) < 25
        assert 10 < np.count_nonzero(is_of_path) < 0.05 * is_of_path.size
        page.later("play", page.toggle)

        # The slider of the amplitude, moved by its arrow key, turns the body otherwise.
        browser.locator("[role=slider][aria-valuenow='400']").first.focus()
        for _ in range(18):
            browser.keyboard.press("ArrowLeft")
        wait(shown, lambda: flight.scenario.reference.amplitude_deg_s == 40.0)
        wait(shown, lambda: abs(flight.now().state[12]) < np.deg2rad(60.0))

        browser.locator(SCENE).click()
        browser.keyboard.press("Space")
        wait(shown, lambda: not page.playing)
        stopped = flight.now().time_s
        browser.keyboard.press("Space")
        wait(shown, lambda: flight.now().time_s > stopped)
        browser.keyboard.press("r")
        wait(shown, lambda: flight.now().time_s < stopped)

        # On a phone at night.
        browser.set_viewport_size({"width": 390, "height": 844})
        browser.get_by_text("View", exact=True).click()
        browser.get_by_label("dark", exact=True).click()
        wait(shown, lambda: shown.pixels(SCENE)[:200].mean() < 100.0)
        assert shown.colours(SCENE) > 50
        assert browser.evaluate("document.documentElement.scrollWidth") <= 390

        assert browser.locator("img[src='x']").count() == 0
        assert shown.errors == []
        assert shown.outside == []
        assert page.server.get_host() == "127.0.0.1"
        assert browser.get_by_text("Share", exact=True).count() == 0
        browser.close()  # an open page is drawn on and on


def test_a_refused_value_is_named_and_its_control_goes_back():
    flight = LiveFlight(load_scenario("fast_turn_unknown_dynamics"))
    page = LivePage(flight, port=8191)
    control = page.handles["controller.P_err"]
    before = control.value
    for value, kept in ((2e-4, 2e-4), (-1.0, 2e-4), (before, before)):
        control.value = value
        page.frame(0.0)
        assert control.value == flight.scenario.controller.P_err == kept
    page.stop()


def test_recorded_runs_play_side_by_side_on_a_phone(open_page):
    scenario = load_scenario("turn_360_left", {"duration_s": 3.0})
    other = override(scenario, {"reference.angle_deg": -360.0})
    flights = [RecordedFlight(simulate(each), f"{SCRIPT}{i}") for i, each in enumerate((scenario, other))]
    with served(RunsPage(flights, port=8195)) as page:
        shown = opened(open_page, page, width=390, height=844)
        wait(shown, lambda: all(each.ended for each in flights))
        width = shown.page.evaluate("document.documentElement.scrollWidth")
        assert width <= 390
        page.later("begin", lambda: page.seek(0.0))
        wait(shown, lambda: 0.0 < flights[0].now().time_s < 3.0)
        left, right = (each.now().state[12] for each in flights)
        assert left == pytest.approx(-right, abs=0.2)
        assert shown.page.locator("img[src='x']").count() == 0
        assert shown.errors == []
        assert shown.outside == []
        shown.page.close()


def test_the_command_says_its_address_once_and_ends_with_ctrl_c(monkeypatch, capfd):
    def interrupted(page):
        page.stop()
        raise KeyboardInterrupt

    monkeypatch.setattr(Page, "run", interrupted)
    result = invoke("view", "--live", "slow_turn_pose_only", "--port", 8199)
    assert result.exit_code == 0
    printed = result.output + "".join(capfd.readouterr())
    assert len(re.findall("http", printed)) == 1
    assert re.search(r"http://127\.0\.0\.1:\d+", result.stderr)
