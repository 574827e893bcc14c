# SPDX-License-Identifier: Apache-2.0
"""The picture of the live page in docs/view.md: ``python benchmarks/view_picture.py docs/figures/view.png``.

The paper's turn in a gust, eight seconds after its beginning, in headless Chromium.
"""

import io
import shutil
import sys
import threading
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from skydiver_utc.parameters import load_scenario
from skydiver_utc.view.live_controls import LivePage
from skydiver_utc.view.live_flight import LiveFlight

LOAD_MS = 120_000
ARGUMENTS = ("--no-sandbox", "--enable-unsafe-swiftshader")


def picture(page: LivePage) -> bytes:
    """A PNG of the page, which stands still."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
        shown = browser.new_page(viewport={"width": 1280, "height": 800})
        shown.set_default_timeout(LOAD_MS)
        shown.goto(page.address)
        shown.wait_for_selector("canvas[data-engine^='three.js']")
        shown.wait_for_selector(".u-title")
        shown.wait_for_timeout(5000)
        # That there is no graphics card here is no part of the page.
        shown.evaluate("document.querySelectorAll('.mantine-Notification-root').forEach(e => e.remove())")
        return shown.screenshot(timeout=LOAD_MS)


def main() -> None:
    """Fly, show, write."""
    flight = LiveFlight(load_scenario("fast_turn_unknown_dynamics"))
    page, done = LivePage(flight), threading.Event()
    for frame in range(200):
        if frame == 175:
            flight.blow()
        page.frame(0.04)
    page.playing = False
    page.options["ahead"] = 0.3
    page.later("draw", lambda: None)
    thread = threading.Thread(target=page.run, args=(done.is_set,))
    thread.start()
    try:
        colours = Image.open(io.BytesIO(picture(page))).convert("RGB").quantize(128)
        colours.save(Path(sys.argv[1]), optimize=True)
    finally:
        done.set()
        thread.join()


if __name__ == "__main__":
    main()
