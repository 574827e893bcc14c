# SPDX-License-Identifier: Apache-2.0
"""The Markdown pages: links lead somewhere, each picture has a command, commands exist."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import yaml
from command_line import invoke
from package_files import ROOT

from skydiver_utc.cli.main import main
from skydiver_utc.parameters import scenario_names

PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("docs/paper/*.md")])
STUDIES = {path.stem for path in ROOT.glob("config/studies/*.yaml")}
each_page = pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
# A file that the command writes, or a command that writes all figures of a page.
DRAWS = re.compile(r"--figure|--out docs/|docs/figures/|study (run|tuning|sensitivity)|make (film|paper)")


def prose(page: Path) -> str:
    return re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Of its headings, as repository views and the site make them."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def commands(page: Path) -> Iterator[list[str]]:
    """Words of each command line, in blocks and in running text; optional parts without their brackets."""
    text = page.read_text(encoding="utf-8")
    block = r"^ *((?:skydiver-utc|make|python) [^`\n]*)$"
    for line in re.findall(block, text, re.MULTILINE) + re.findall(
        r"`((?:skydiver-utc|make|python) [^`]*)`", text
    ):
        part = re.split(r"\s#|&&|\||\\$", re.sub(r"[\[\]]|\.\.\.", "", line))[0]
        yield shlex.split(part)


@each_page
def test_links_lead_to_files_and_headings(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        path, _, anchor = target.partition("#")
        if not path.startswith(("http:", "https:")):
            found = page.parent / path if path else page
            assert found.exists(), target
            assert not anchor or anchor in anchors(found), target


@each_page
def test_a_page_with_pictures_names_the_command_that_draws_them(page: Path) -> None:
    assert "![" not in prose(page) or any(DRAWS.search(" ".join(words)) for words in commands(page))


@each_page
def test_commands_exist_with_their_options_and_scenarios(page: Path) -> None:
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for name, *words in commands(page):
        if name == "make":
            assert words[0] in targets
        elif name == "python" and words[0].islower() and words[0][0] != "-":
            assert (ROOT / words[0]).is_file()
        elif name == "skydiver-utc":
            context, group, command = click.Context(main), None, main
            while isinstance(command, click.Group) and words and words[0].islower() and words[0][0] != "-":
                group, command = command, command.get_command(context, words.pop(0))
            assert command is not None
            options = {option for parameter in command.params for option in parameter.opts}
            given = {word.partition("=")[0] for word in words if word.startswith("--")}
            assert given <= options | {"--help", "--version"}, words
            if command.name in ("simulate", "run") and words and re.fullmatch(r"[a-z_0-9]+", words[0]):
                assert words[0] in (scenario_names() if group is main else STUDIES)


def test_the_study_of_the_page_flies(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "studies.md").read_text(encoding="utf-8")
    found = re.search(r"^ +name: (?:.*\n)*?\n", text, re.MULTILINE)
    assert found is not None
    study = {**yaml.safe_load(found[0]), "runs": 1}
    study["set"]["duration_s"] = 0.1
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study), encoding="utf-8")
    done = invoke("study", "run", tmp_path / "study.yaml", "--workers", 1, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.stderr


def test_the_ways_to_a_full_ros_can_be_read() -> None:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.11 and later have it")
    pixi = tomllib.loads((ROOT / "pixi.toml").read_text(encoding="utf-8"))
    assert pixi["tasks"]["demo"].split()[-1] in scenario_names()
    assert pixi["pypi-dependencies"]["skydiver_utc"]["path"] == "."
