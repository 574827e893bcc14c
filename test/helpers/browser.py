# SPDX-License-Identifier: Apache-2.0
"""Pages in headless Chromium: `open_page` shows one, with its errors and its requests outside this machine.

Debian's `chromium` driven by playwright, which downloads nothing here. Names outside this machine are not resolved.

PYTEST_DONT_REWRITE: tests import names from here before pytest loads it as a plugin.
"""

import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import numpy as np
import pytest
from child_processes import PATIENCE_S
from numpy.typing import NDArray
from PIL import Image

_CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
_ARGUMENTS = (
    "--no-sandbox",  # it cannot be had by root
    "--enable-unsafe-swiftshader",  # WebGL without a graphics card
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost, EXCLUDE 127.0.0.1",
)
_OF_THIS_MACHINE = ("localhost", "127.0.0.1")
_WITHOUT_HOST = ("file", "data", "blob", "about")


class OpenedPage(NamedTuple):
    """A page; its console's errors and uncaught exceptions, and the addresses outside this machine, until now."""

    page: Any  # a playwright.sync_api.Page
    errors: list[str]
    outside: list[str]

    def colours(self, selector: str) -> int:
        """How many different colours the pixels of an element have: one or two where it is blank."""
        return len(np.unique(self.pixels(selector).reshape(-1, 3), axis=0))

    def pixels(self, selector: str) -> NDArray[np.uint8]:
        """What an element looks like (height, width, 3)."""
        # An element's own screenshot waits until it is still, which a body that plays never is.
        box = self.page.locator(selector).first.evaluate(
            "(e) => { e.scrollIntoView({ block: 'center' }); return e.getBoundingClientRect().toJSON() }"
        )
        png = self.page.screenshot(clip={name: box[name] for name in ("x", "y", "width", "height")})
        return np.asarray(Image.open(BytesIO(png)).convert("RGB"))


OpenPage = Callable[..., OpenedPage]


@pytest.fixture(scope="module")
def open_page() -> Iterator[OpenPage]:
    """open_page(target, width=1280, height=900): a file or an address, loaded."""
    playwright = pytest.importorskip("playwright.sync_api")
    if _CHROMIUM is None:
        pytest.skip("there is no Chromium: apt-get install chromium")
    with ExitStack() as stack:
        driver = stack.enter_context(playwright.sync_playwright())
        browser = driver.chromium.launch(executable_path=_CHROMIUM, args=_ARGUMENTS)
        stack.callback(browser.close)

        def show(target: Path | str, width: int = 1280, height: int = 900) -> OpenedPage:
            page = browser.new_page(viewport={"width": width, "height": height})
            page.set_default_timeout(1000.0 * PATIENCE_S)
            shown = OpenedPage(page, [], [])
            page.on("console", lambda line: line.type == "error" and shown.errors.append(line.text))
            page.on("pageerror", lambda error: shown.errors.append(str(error)))
            for event in ("request", "websocket"):
                page.on(event, lambda made: _is_outside(made.url) and shown.outside.append(made.url))
            page.goto(target.resolve().as_uri() if isinstance(target, Path) else target)
            return shown

        yield show


def _is_outside(address: str) -> bool:
    parts = urlsplit(address)
    return parts.scheme not in _WITHOUT_HOST and parts.hostname not in _OF_THIS_MACHINE
