# SPDX-License-Identifier: Apache-2.0
"""The documentation site, without its gallery's runs, in headless Chromium."""

import subprocess
import sys
from pathlib import Path

import pytest
from browser import OpenPage
from package_files import ROOT

pytest_plugins = ("browser",)
pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built as by `make docs`: a warning, such as a link that leads nowhere, is an error."""
    pytest.importorskip("sphinx", reason="needs the extra docs")
    folder = tmp_path_factory.mktemp("site")
    options = f"-W --keep-going --quiet -b html -c docs -d {folder / 'doctrees'} -D plot_gallery=0".split()
    command = [sys.executable, "-m", "sphinx", *options, ".", str(folder / "html")]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return folder / "html"


def test_pages_open_without_errors_and_without_the_network(site: Path, open_page: OpenPage) -> None:
    """Their own first page, the longest page of the interface, and the gallery."""
    for name in ("index", "docs/index", "docs/api", "docs/commands", "docs/gallery/index"):
        shown = open_page(site / f"{name}.html")
        shown.page.wait_for_load_state("load")
        assert (shown.errors, shown.outside) == ([], [])
    assert open_page(site / "index.html").page.wait_for_url("**/docs/index.html") is None


def test_the_first_screen_shows_the_body_the_turn_and_three_doors(site: Path, open_page: OpenPage) -> None:
    shown = open_page(site / "docs" / "index.html")
    for scheme in ("light", "dark"):
        shown.page.emulate_media(color_scheme=scheme)
        assert shown.colours("img[src$='skydiver.gif']") > 10
        assert shown.colours("img[src$='fast_turn_unknown_dynamics.png']") > 10
    doors = shown.page.locator(".sd-card a")
    pages = [Path(doors.nth(i).get_attribute("href") or "").stem for i in range(3)]
    assert pages == ["library", "ros", "skydiver"]


def test_it_can_be_read_on_a_telephone(site: Path, open_page: OpenPage) -> None:
    page = open_page(site / "docs" / "index.html", width=390, height=800).page
    for name in ("index", "library", "tutorial"):
        page.goto((site / "docs" / f"{name}.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
