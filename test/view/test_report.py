# SPDX-License-Identifier: Apache-2.0
"""The report: every run has one, it is small, opens offline, plays, and nothing in a run becomes HTML or script."""

import base64
import dataclasses
import json
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PATIENCE_S, OpenedPage, OpenPage
from runs import CART, cart, odd_runs, random_run, run_of, skydiver

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import from_yaml, load_scenario
from skydiver_utc.studies.paper_words import paper_words
from skydiver_utc.view.report import Flown, report_html
from skydiver_utc.view.signals import charts

pytest_plugins = ("browser",)

HOSTILE = "</script><script>hacked = 1</script><img src=http://example.org/x onerror='hacked = 1'>"
CURSOR = "document.getElementById('time').textContent"


def page(*runs: Run, **versions: str) -> str:
    return report_html([Flown(f"run {i}", run, metrics(run), versions) for i, run in enumerate(runs)])


def data_of(text: str) -> dict[str, Any]:
    found = re.search('id="data">(.*?)</script>', text)
    assert found
    content: dict[str, Any] = json.loads(found[1])
    return content


def turning(duration_s: float = 4.0, dt_s: float = 0.05, **fields: Any) -> Run:
    """A skydiver who turns evenly about the vertical, with telemetry of UTC."""
    scenario = skydiver(duration_s, dt_s)
    run = run_of(np.linspace(80.0, 120.0, scenario.steps + 1), scenario=scenario)
    angle = 1.75 * run.time_s
    run.states[:, 5], run.states[:, 6] = np.sin(angle / 2), np.cos(angle / 2)
    t = run.time_s[:-1]
    return dataclasses.replace(
        run,
        telemetry=np.column_stack([np.full_like(t, 0.1), np.sin(t) ** 2, 0 * t]),
        telemetry_names=("std_alpha", "repaired_covariance", "recovery"),
        **fields,
    )


def titles(text: str) -> set[str]:
    return {chart["title"] for chart in data_of(text)["charts"]}


def test_a_page_has_metrics_charts_stills_scenario_and_versions() -> None:
    text = page(turning(), numpy="2.4.6")
    for part in ("Synthetic run", "yaw rate: RMSE from 2 s on", "2.4.6", "epoch_s: 1700000000", "<ellipse"):
        assert part in text
    drawn = {"yaw rate", "yaw rate: error", "alpha", "body rates", "attitude", "speed", "solve time"}
    assert drawn | {"repaired covariance"} <= titles(text)
    (alpha,) = (chart for chart in data_of(text)["charts"] if chart["title"] == "alpha")
    assert [curve["role"] for curve in alpha["curves"]] == ["band", "command", "value"]
    assert alpha["limits"] == [-1.0, 1.0]


def test_the_words_of_the_paper_stand_beside_its_own_scenarios_only() -> None:
    shipped = load_scenario("fast_turn_unknown_dynamics", {"duration_s": 4.0})
    assert "4 deg/s" in paper_words(shipped)["yaw rate: RMSE"]
    assert not paper_words(load_scenario("fast_turn_unknown_dynamics", {"controller.horizon_steps": 5}))
    assert not paper_words(skydiver())


def test_an_estimator_has_its_innovations_and_errors() -> None:
    names = ("nis_camera", "estimate_place", "deviation_place")
    telemetry = np.random.default_rng(1).normal(size=(80, 3))
    telemetry[::2, 0] = np.nan  # measured in every other step
    data = data_of(page(run_of(scenario=cart(), telemetry=telemetry, telemetry_names=names)))
    found = {chart["title"]: chart for chart in data["charts"] if chart["section"] == "Estimator"}
    nis, error = found["camera: innovation squared (NIS)"], found["place: error of the estimate"]
    assert len(base64.b64decode(nis["curves"][0]["y"])) == 4 * 40
    assert [curve["role"] for curve in error["curves"]] == ["band", "value"]


def test_wind_and_errors_of_the_measured_state_are_drawn_where_they_acted() -> None:
    acted = np.zeros((81, 4))
    acted[40:, 0], acted[:, 1], acted[60, 3] = 5.0, np.deg2rad(2.0), 1.0
    run = turning(disturbance=acted, disturbance_names=("wind_x", "error_wz", "error_vx", "push_vz"))
    found = {chart["title"]: chart for chart in charts([run], [""]) if chart["section"] == "Disturbances"}
    assert found["wind"]["curves"][0]["y"].max() == 5.0
    (error,) = found["measured less true state"]["curves"]
    np.testing.assert_allclose(error["y"], 2.0)
    (push,) = found["pushed by"]["curves"]
    assert push["y"].argmax() == 60


def test_another_plant_has_its_own_signals() -> None:
    text = page(random_run(cart()))
    assert {"place", "speed: error", "force", "states", "innovation", "clipped"} <= titles(text)
    assert "<iframe" not in text


def test_several_runs_are_curves_of_the_same_charts() -> None:
    text = page(turning(), turning(3.0), run_of(scenario=cart()))
    by_title = {chart["title"]: [c["name"] for c in chart["curves"]] for chart in data_of(text)["charts"]}
    assert by_title["yaw rate"] == ["reference", "run 0", "run 1"]
    assert by_title["body rates: about z, yaw"] == ["run 0", "run 1"]
    assert by_title["force"] == ["run 2"]
    assert text.count("with all settings</summary>") == 3


@pytest.mark.parametrize("name", odd_runs())
def test_every_run_has_a_page(name: str) -> None:
    assert data_of(page(odd_runs()[name]))["charts"]


def test_curves_of_many_steps_keep_their_extremes_and_holes() -> None:
    run = turning(20.0, 0.0042)
    rates = np.full(len(run.states), 0.1)
    rates[1234], rates[4321], rates[2000:2050] = 7.0, -7.0, np.nan
    run.states[:, 12] = rates
    (yaw,) = (c for chart in charts([run], [""]) for c in chart["curves"] if c["name"] == "about z, yaw")
    assert len(yaw["y"]) <= 1202
    at = dict(zip(yaw["t"], np.deg2rad(yaw["y"]), strict=True))
    assert at[run.time_s[1234]] == pytest.approx(7.0)
    assert at[run.time_s[4321]] == pytest.approx(-7.0)
    assert np.isnan(yaw["y"][(yaw["t"] > run.time_s[2005]) & (yaw["t"] < run.time_s[2045])]).all()


def test_20_s_of_a_skydiver_are_2_5_mb_at_most_and_take_6_s_of_cpu_at_most() -> None:
    run = turning(20.0, 0.0042)
    begin = time.process_time()
    text = page(run)
    assert time.process_time() - begin < 6.0
    assert len(text.encode()) < 2.5e6


@pytest.fixture(scope="module")
def shown(open_page: OpenPage, tmp_path_factory: pytest.TempPathFactory) -> OpenedPage:
    """The page of a run that turns, playing."""
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page(turning(20.0)), encoding="utf-8")
    opened = open_page(path)
    opened.page.wait_for_function("playerTime() > 0.2")
    return opened


def seen(opened: OpenedPage) -> float:
    """The cursor's time [s]."""
    return float(opened.page.evaluate(CURSOR).split()[0])


def shows_a_body(opened: OpenedPage) -> bool:
    """Wait until the scene, without the player's bar below it, has the colours of a body."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        scene = opened.pixels("iframe")[:-60].astype(int)
        if np.count_nonzero(np.ptp(scene, axis=2) > 90) > 300:
            return True
    return False


@pytest.mark.long
def test_the_body_plays_with_the_charts_and_all_keys(shown: OpenedPage) -> None:
    window = shown.page
    assert shown.colours(".plot") > 20
    assert shows_a_body(shown)
    before = seen(shown)
    window.wait_for_function(f"parseFloat({CURSOR}) > {before} || parseFloat({CURSOR}) < {before - 1}")
    window.keyboard.press("Home")  # a jump pauses
    window.wait_for_function("playerTime() === 0")
    window.keyboard.press("ArrowRight")
    window.wait_for_function("Math.abs(playerTime() - 0.1) < 1e-3")
    window.keyboard.press("End")
    window.wait_for_function("Math.abs(playerTime() - 20) < 1e-3")
    first = window.locator("[data-time]").first
    first.click()
    window.wait_for_function("playerTime() === 0")
    box = window.locator(".plot").first.bounding_box()
    window.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 30.0)
    window.wait_for_function("Math.abs(playerTime() - 10) < 1")
    window.mouse.move(0.0, 0.0)
    window.keyboard.press("Space")
    window.wait_for_function("playerTime() > 11")
    assert (shown.errors, shown.outside) == ([], [])


@pytest.mark.long
def test_a_drag_zooms_and_escape_shows_the_whole_run(shown: OpenedPage) -> None:
    window, box = shown.page, shown.page.locator(".plot").first.bounding_box()
    window.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 30.0)
    window.mouse.down()
    window.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 30.0, steps=3)
    window.mouse.up()
    assert 4.0 < window.evaluate("view.end - view.begin") < 8.0
    window.keyboard.press("Escape")
    assert window.evaluate("view.end - view.begin") == pytest.approx(20.0)


@pytest.mark.long
def test_a_phone_at_night(shown: OpenedPage) -> None:
    shown.page.emulate_media(color_scheme="dark")
    shown.page.set_viewport_size({"width": 390, "height": 844})
    assert shown.page.evaluate("document.documentElement.scrollWidth") <= 390
    assert shown.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(22, 25, 28)"
    assert shows_a_body(shown)
    assert (shown.errors, shown.outside) == ([], [])


@pytest.mark.long
def test_nothing_in_a_run_becomes_html_or_script(open_page: OpenPage, tmp_path: Path) -> None:
    names = {"place": HOSTILE, "speed": f"{HOSTILE} 2"}
    plant = CART.replace("[place, speed]", json.dumps(list(names.values()))).replace(
        "{place: 2.0, speed: 0.0}", json.dumps(dict.fromkeys(names.values(), 1.0))
    )
    run = random_run(from_yaml(plant).model_copy(update={"title": HOSTILE, "description": HOSTILE}))
    flown = Flown(HOSTILE, run, metrics(run), {HOSTILE: HOSTILE})
    for count in (1, 2):
        path = tmp_path / f"report_{count}.html"
        path.write_text(report_html([flown] * count), encoding="utf-8")
        opened = open_page(path)
        assert opened.page.evaluate("typeof hacked") == "undefined"
        assert HOSTILE in opened.page.text_content("h1")
        opened.page.keyboard.press("Space")  # without a body it plays, too
        opened.page.wait_for_function(f"parseFloat({CURSOR}) > 0")
        assert (opened.errors, opened.outside) == ([], [])
        opened.page.close()
