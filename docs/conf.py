# SPDX-License-Identifier: Apache-2.0
"""The documentation site, built by `make docs` from the root of the repository.

Its sources are the Markdown pages as they stand, so that a link works in a repository's web view and in the site alike.
The gallery runs every example while the site is built. Equations are plain text in the sources: no maths renderer.
"""

import ast
import re
import shutil
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "build" / "examples"  # with docstrings as sphinx-gallery wants them

project = "skydiver_utc"
author = "skydiver_utc maintainers"
copyright = "skydiver_utc maintainers, Apache 2.0"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_click",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
root_doc = "docs/index"
include_patterns = ["docs/**", "CHANGELOG.md", "CONTRIBUTING.md", "README.md"]
exclude_patterns = ["docs/site/**", "docs/gallery/**/*.ipynb", "docs/gallery/**/*.py"]
suppress_warnings = ["config.cache"]  # functions in the gallery's settings
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
highlight_language = "none"  # of indented blocks: commands and equations
default_role = "code"  # docstrings are written like Markdown
autodoc_member_order = "bysource"

html_theme = "pydata_sphinx_theme"
html_title = "skydiver_utc"
html_static_path = ["site/static"]
templates_path = ["site/templates"]
html_css_files = ["site.css"]
html_additional_pages = {"index": "redirect.html"}
html_copy_source = False
html_context = {"default_mode": "auto"}  # light or dark, as the reader has it
html_theme_options = {
    "show_prev_next": False,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
}


def titled(script: Path, out: Path) -> None:
    """Write a script whose docstring begins with a heading: its first words."""
    text = script.read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(text)) or ""
    title, end, body = re.split(r"([:.]\s| \()", docstring, maxsplit=1)
    body = docstring if end == " (" else body
    title, body = title.replace("`", ""), re.sub(r"`([^`]*)`", r"``\1``", body)
    heading = f"{title}\n{'=' * len(title)}\n\n{body[:1].upper()}{body[1:]}\n"
    found = re.search(r'^r?"""(.*?)"""', text, re.MULTILINE | re.DOTALL)
    assert found is not None
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(f'{text[: found.start()]}r"""\n{heading}"""{text[found.end() :]}', encoding="utf-8")


def write_examples() -> None:
    """The scripts of the gallery, and the headings of its two parts."""
    shutil.rmtree(EXAMPLES, ignore_errors=True)
    for name in ("skydiver", "quadcopter", "cart_pole", "admire", "scalar_linear"):
        titled(ROOT / "examples" / f"{name}.py", EXAMPLES / f"{name}.py")
    for script in (ROOT / "examples" / "features").glob("*.py"):
        titled(script, EXAMPLES / "features" / script.name)
    shutil.copy(ROOT / "examples" / "show.py", EXAMPLES)
    (EXAMPLES / "GALLERY_HEADER.rst").write_text(
        "Gallery\n=======\n\nEvery example is run while this site is built; it is a script and a notebook, too.\n"
        "\nPlants\n------\n\nTheir notebooks need ``show.py``, which stands beside the scripts in ``examples/``.\n"
    )
    (EXAMPLES / "features" / "GALLERY_HEADER.rst").write_text(
        "Features\n--------\n\nOne option of the controller each.\n"
    )


def arguments(gallery_conf: object, script: dict[str, str]) -> list[str]:
    """The plants' scripts draw their figure where `--figure` says; the features' have no figure."""
    figure = EXAMPLES / "figure.png"
    return [] if "features" in script["src_file"] else ["--figure", str(figure)]


write_examples()
sphinx_gallery_conf = {
    "examples_dirs": [str(EXAMPLES)],
    "gallery_dirs": ["docs/gallery"],
    "filename_pattern": "",
    "ignore_pattern": r"show\.py",
    "reset_argv": arguments,
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "download_all_examples": True,
    "remove_config_comments": True,
}


def docstring_as_plain_text(
    app: object, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Docstrings are plain text with code in backticks; indented paragraphs and lists of names keep their lines."""
    paragraphs = "\n".join(lines).strip().split("\n\n")
    lines[:] = "\n\n".join(map(_marked_up, paragraphs)).splitlines()


def _marked_up(paragraph: str) -> str:
    names = re.findall(r"^[\w ,]+(?:\([^)]*\))?: ", paragraph, re.MULTILINE)
    if len(names) > 1 or re.search(r"^ |\S {2}", paragraph, re.MULTILINE):
        return "::\n\n" + "\n".join(f"   {line}" for line in paragraph.splitlines())
    parts = re.split(r"(`[^`]*`)", paragraph)
    parts[::2] = [re.sub(r"([*|_\\])", r"\\\1", part) for part in parts[::2]]
    return "".join(parts)


def without_links_to_folders(app: Any, page: str, source: list[str]) -> None:
    """A link to a folder of the repository becomes its text: the site has no pages of folders."""
    folder = (Path(app.srcdir) / page).parent

    def shown(link: re.Match[str]) -> str:
        return link[1] if (folder / link[2]).is_dir() else link[0]

    source[0] = re.sub(r"\[([^\]]+)\]\(([^):#]+)\)", shown, source[0])


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", docstring_as_plain_text)
    app.connect("source-read", without_links_to_folders)
