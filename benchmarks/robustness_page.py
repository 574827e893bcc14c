# SPDX-License-Identifier: Apache-2.0
"""Tables and figures of docs/robustness.md from the studies: ``python benchmarks/robustness_page.py``.

Of each study that was flown (``skydiver-utc study run NAME``, folder studies/NAME) the tables of report.md replace what
stands between its two marks in the page, and maps.png its figure.
"""

import re
import shutil
from pathlib import Path

import click

PAGE = Path(__file__).resolve().parents[1] / "docs" / "robustness.md"
MARKED = re.compile(r"(<!-- study (\w+) -->\n).*?(\n<!-- end -->)", re.DOTALL)


def tables(report: str) -> str:
    """The report's first line and its tables."""
    return "\n\n".join(
        part for part in report.split("\n\n")[2:] if part[:1].isdigit() or part[:1] == "|"
    ).strip()


@click.command(help=__doc__)
@click.option("--studies", default="studies", type=click.Path(path_type=Path, exists=True), show_default=True)
def main(studies: Path) -> None:
    def replaced(found: re.Match[str]) -> str:
        folder = studies / found[2]
        if not (folder / "report.md").is_file():
            return found[0]
        shutil.copyfile(folder / "maps.png", PAGE.parent / "figures" / f"robustness_{found[2]}.png")
        return found[1] + tables((folder / "report.md").read_text(encoding="utf-8")) + found[3]

    PAGE.write_text(MARKED.sub(replaced, PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
