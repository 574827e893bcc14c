"""The report: whole, in one file, and safe whatever a scenario is called."""

from html.parser import HTMLParser
from typing import Any

import msgspec
import pytest
from test_analysis_metrics import flight_of, scenario_of

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.report import report_html
from skydiver_utc.parameters import to_yaml
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import Outcome


class Page(HTMLParser):
    """The text of a page, its tags, and where they point to."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.sources: list[str] = []
        self.texts: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def page_of(flight: Flight, **versions: str) -> Page:
    return Page(report_html(flight, metrics(flight), b"picture", versions))


def test_everything_is_in_the_page_itself() -> None:
    page = page_of(flight_of(103.0), numpy="2.4.6")
    for part in ("Synthetic flight", "completed", "RMSE from 2 s on", "3.00", "numpy", "2.4.6"):
        assert part in page.texts
    assert to_yaml(scenario_of()) in page.texts
    assert page.sources == ["data:image/png;base64,cGljdHVyZQ=="]


def test_what_is_not_defined_is_a_dash() -> None:
    assert "-" in page_of(flight_of(steps=3, outcome=Outcome.ABORTED)).texts


@pytest.mark.parametrize("field", ["title", "description"])
def test_a_scenario_cannot_write_html(field: str) -> None:
    changes: dict[str, Any] = {field: "<script>alert($png)</script>"}
    scenario = msgspec.structs.replace(scenario_of(), **changes)
    page = page_of(flight_of(scenario=scenario))
    assert "script" not in page.tags
    assert "<script>alert($png)</script>" in page.texts
