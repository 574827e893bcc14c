# SPDX-License-Identifier: Apache-2.0
"""The comparison with the paper: which runs, what is kept, what is decided, and the pages that are made of it."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import invoke
from matplotlib.image import imread
from pinned import PINNED
from telemetry_figure import telemetry_figure
from tuning_guide import STEPS

from skydiver_utc.cli.settings import load as load_from_command_line
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.linear_loop import updated_control
from skydiver_utc.parameters import load_scenario
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies import paper_results
from skydiver_utc.studies.cases import case, measure, run_all
from skydiver_utc.studies.claim import Claim, Verdict
from skydiver_utc.studies.claims_theory import mean_square
from skydiver_utc.studies.markdown import figure
from skydiver_utc.studies.paper_page import checklist, details, page
from skydiver_utc.studies.paper_results import (
    HandPush,
    PaperResults,
    StepCost,
    Tunings,
    flights,
    hand_push,
    tunings,
)
from skydiver_utc.studies.sensitivity import NUMBERS, Calibration, calibrations, changed

pytestmark = pytest.mark.long

PAPER = Path(__file__).resolve().parents[2] / "docs" / "paper"
SHIPPED = PaperResults.model_validate_json((PAPER / "results.json").read_bytes())
# Rounding alone moves the RMSE of a flight of 20 s by 1 %: a start 1e-9 m/s faster does.
SAME_FLIGHT = 0.05


def claim(results: PaperResults, words: str) -> Claim:
    (found,) = (one for one in checklist(results) if words in one.words)
    return found


def with_measures(**fields: dict[str, Any]) -> PaperResults:
    """The shipped results with other numbers in runs of `flown`, by their names; `every` changes all runs."""
    every = fields.pop("every", {})
    found = {command: one.replace(**every) for command, one in SHIPPED.measures.items()}
    for name, changes in fields.items():
        command = getattr(flown, name).command
        found[command] = found[command].replace(**changes)
    return SHIPPED.replace(measures=found)


def with_rmse(**rmse: float) -> PaperResults:
    return with_measures(**{name: {"rmse_deg_s": value} for name, value in rmse.items()})


def with_all_converging(*scenarios: str) -> PaperResults:
    """The shipped results with random tunings of these scenarios that all converge."""
    found = dict.fromkeys(scenarios, Tunings(count=9, converged=9, rmse=1.0))
    return SHIPPED.replace(tuning=SHIPPED.tuning | found)


def with_effort(other: float, converged_s: float) -> PaperResults:
    """The effort of M1_C3 is 1, of another configuration that converges at this time `other`, of all others 2."""
    another = {"control_effort": other, "convergence_time_s": converged_s}
    return with_measures(every={"control_effort": 2.0}, M1_C3={"control_effort": 1.0}, M0_C3=another)


def with_cost(held: float, every_step: float) -> PaperResults:
    return SHIPPED.replace(cost=StepCost(held=held, every_step=every_step))


@pytest.mark.parametrize(
    ("words", "results", "verdict"),
    [
        ("Convenient tuning", SHIPPED, "PARTLY"),
        ("Convenient tuning", with_measures(every={"hands_correlation": 1.0}), "FAILS"),
        ("the accuracy is better", SHIPPED, "HOLDS"),
        ("the accuracy is better", with_rmse(M1_C2=50.0), "FAILS"),
        ("accurately tracks", with_rmse(M1_C2=3.0, M1_C3=2.0, M0_C2=4.0), "HOLDS"),
        ("accurately tracks", with_rmse(M1_C2=50.0), "PARTLY"),
        ("need not be parameterised", SHIPPED, "HOLDS"),
        ("need not be parameterised", with_rmse(M1_C2=50.0), "PARTLY"),
        ("With alpha unknown", with_rmse(M0_C2=3.0, M0_C3=4.0, M0_NONE=4.0), "PARTLY"),
        ("With alpha unknown", with_rmse(M0_C2=3.0, M0_C3=2.0, M0_NONE=3.0), "FAILS"),
        ("control effort is least", with_effort(1.1, 1.0), "HOLDS"),
        ("control effort is least", with_effort(0.9, 1.0), "FAILS"),
        ("control effort is least", with_effort(0.9, 19.0), "HOLDS"),
        ("Propagating nine sigma points", with_cost(1.5, 20.0), "HOLDS"),
        ("Propagating nine sigma points", with_cost(0.9, 20.0), "PARTLY"),
        ("Propagating nine sigma points", with_cost(0.9, 0.8), "FAILS"),
        ("no convergence problems", SHIPPED, "PARTLY"),
        (
            "no convergence problems",
            with_measures(every={"rescued_steps": 0, "status_steps": {"solved": 100}}),
            "HOLDS",
        ),
        ("Not much sensitivity", SHIPPED, "FAILS"),
        ("Not much sensitivity", with_all_converging(flown.UNKNOWN), "PARTLY"),
        ("Not much sensitivity", with_all_converging(flown.UNKNOWN, flown.PI), "HOLDS"),
        ("minimum mean square error", SHIPPED, "HOLDS"),
        ("For linear systems stability", SHIPPED, "HOLDS"),
    ],
)
def test_a_claim_is_decided_by_the_measures(words: str, results: PaperResults, verdict: str) -> None:
    assert claim(results, words).verdict.name == verdict


def test_the_hands_are_needed_by_their_force_or_by_their_moment() -> None:
    assert "it is the airspeed" in claim(SHIPPED, "input moments").why
    names = (flown.FORCE_ALONE, flown.MOMENT_ALONE)
    force, moment = ([one.command for one in flown.HANDS[name]] for name in names)
    other = dict(zip([*force, *moment], [60.0] * 3 + [2.0] * 3, strict=True))
    found = {k: m.replace(rmse_deg_s=other.get(k, m.rmse_deg_s)) for k, m in SHIPPED.measures.items()}
    assert "not the bank" not in claim(SHIPPED.replace(measures=found), "input moments").why


def test_the_closed_form_of_the_update_is_computed() -> None:
    assert mean_square(lambda *given: (1.0 + 1e-9) * updated_control(*given)).verdict is Verdict.FAILS


def test_a_command_can_be_typed() -> None:
    """What a page prints is what the command line reads: the same scenario comes of both."""
    kinds = {
        (one.scenario, tuple(name for name, _ in one.settings)): one for one in flown.all_cases().values()
    }
    for one in kinds.values():
        scenario, *settings = one.command.split(" --set ")
        assert load_from_command_line(scenario, settings) == one.load(), one.command


def test_results_do_not_depend_on_the_number_of_processes() -> None:
    settings = (("controller.horizon_steps", n) for n in (2, 3, 4))
    scenarios = {str(one[1]): case("fast_turn_pi_dynamics", one).load(2.5) for one in settings}
    seen: list[int] = []
    alone, together = (run_all(scenarios, measure, workers, seen.append) for workers in (1, 2))
    assert seen == [1, 2, 3, 1, 2, 3]
    assert list(together) == list(scenarios)
    assert alone == together
    assert len({one.rmse_deg_s for one in alone.values()}) == 3
    with pytest.raises(ZeroDivisionError):
        run_all(scenarios, refuse, 2, seen.append)


def refuse(_flight: object) -> None:
    raise ZeroDivisionError


class TestShippedPage:
    """docs/paper is what the command writes, and its figures are those of flights."""

    def test_the_page_is_made_from_all_flights_in_full_with_its_pictures_and_reasons(self) -> None:
        pages = [(PAPER / name).read_text(encoding="utf-8") for name in ("paper.md", "details.md")]
        assert pages == [page(SHIPPED), details(SHIPPED)]
        shown = {part.partition(")")[0] for part in "".join(pages).split("](")[1:]}
        assert shown >= {f"{label}.png" for label in flown.FIGURES}
        assert all((PAPER / name).is_file() for name in shown)
        assert all(one.why for one in checklist(SHIPPED) if one.verdict is not Verdict.HOLDS)
        assert not SHIPPED.quick
        assert list(SHIPPED.measures) == list(flown.all_cases())
        assert [one.changed for one in SHIPPED.sensitivity] == list(calibrations())
        assert {one.count for one in SHIPPED.tuning.values()} == {100}
        converged = {name: one.converged for name, one in SHIPPED.tuning.items()}
        assert converged[flown.UNKNOWN_INSENSITIVE] > 90 > 50 > converged[flown.UNKNOWN]

    def test_its_figures_are_those_of_the_scenarios(self) -> None:
        shown = {name: one for name, one in SHIPPED.measures.items() if name in PINNED}
        assert len(shown) > 5
        for name, shipped in shown.items():
            assert shipped.outcome == PINNED[name]["outcome"]
            for key in ("rmse_deg_s", "max_abs_error_deg_s", "control_effort", "peak_yaw_rate_deg_s"):
                assert getattr(shipped, key) == pytest.approx(PINNED[name][key], rel=SAME_FLIGHT), (name, key)

    def test_a_flight_with_other_settings_flies_again(self) -> None:
        one = flown.VARIANTS[2].flown
        assert one is not None
        shipped, now = SHIPPED.of(one), measure(simulate(one.load()))
        assert now.outcome == shipped.outcome
        assert now.rmse == pytest.approx(shipped.rmse, rel=SAME_FLIGHT)

    def test_the_readme_has_the_pinned_figures(self) -> None:
        text = (PAPER.parents[1] / "README.md").read_text(encoding="utf-8")
        rows = re.findall(r"^\| `(\w+)`[^|]*\| ([\d.]+)", text, re.MULTILINE)
        assert len(rows) > 1
        for name, printed in rows:
            assert float(printed) == pytest.approx(PINNED[name]["rmse_deg_s"], rel=SAME_FLIGHT), name


def test_tunings_are_counted_by_scenario() -> None:
    """Of two tunings one converges in the first half; the number of a run says whose it is."""
    good = SHIPPED.of(flown.M0_C2)
    late = good.replace(convergence_time_s=15.0, rmse_deg_s=None)
    found = tunings({f"tuning/{n}": late if n == 4 else good for n in range(8)} | {"other": late})
    assert found[flown.UNKNOWN] == Tunings(count=2, converged=1, rmse=good.rmse)
    assert found[flown.PI] == Tunings(count=2, converged=2, rmse=good.rmse)


def test_figures_have_two_digits_or_are_whole() -> None:
    values = (None, float("inf"), 138.4, 9.96, 9.94, -0.84, 0.996)
    assert [figure(value) for value in values] == ["-", "-", "138", "10", "9.9", "-0.84", "1.0"]


def test_every_flight_of_the_tuning_guide_loads_and_is_shown_in_it() -> None:
    text = (PAPER.parent / "tuning-skydiver.md").read_text(encoding="utf-8")
    for step in STEPS:
        assert f"figures/tuning/{step.name}.png" in text
        assert (PAPER.parent / "figures" / "tuning" / f"{step.name}.png").is_file()
        for one in step.cases.values():
            assert isinstance(one.load().controller, UtcSettings)


def test_a_quick_comparison_flies_shortly_writes_its_files_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {one.command: one for one in (*flown.FIGURES.values(), flown.M0_SHORT)}
    monkeypatch.setattr(paper_results, "all_cases", lambda: few)
    monkeypatch.setattr("skydiver_utc.studies.paper_files.QUICK_S", 2.1)
    monkeypatch.setattr(paper_results, "QUICK_S", 2.1)
    wanted = flights(quick=True)
    assert len(wanted) == len(few) + 4 + 6  # a tuning of each scenario, and the skydiver as calibrated
    assert {one.duration_s for one in wanted.values()} == {2.1}
    results = paper_results.run_comparison(wanted, quick=True, workers=1, done=lambda _count: None)
    assert list(results.measures) == list(few)
    assert results.of(flown.M1_C2) == measure(simulate(wanted[flown.M1_C2.command]))
    assert min(results.cost.held, results.cost.every_step) > 0.0
    assert {one.count for one in results.tuning.values()} == {1}
    (as_calibrated,) = results.sensitivity
    assert as_calibrated.rmse[1] == results.of(flown.M1_C2).rmse_deg_s

    whole = results.replace(measures=SHIPPED.measures, sensitivity=SHIPPED.sensitivity)
    monkeypatch.setattr(paper_results, "flights", lambda quick: {"quick": quick})
    monkeypatch.setattr(
        paper_results, "run_comparison", lambda *given: whole if given[1:3] == (True, 3) else None
    )
    arguments = ("compare", "paper", "--quick", "--workers", "3", "--out", tmp_path)
    shown = json.loads(invoke(*arguments, "--json").stdout)
    assert len(shown["claims"]) == len(checklist(whole))
    written = (tmp_path / "results.json").read_bytes()
    assert shown["measures"] == json.loads(written)["measures"]
    assert PaperResults.model_validate_json(written) == whole
    assert (tmp_path / "paper.md").read_text(encoding="utf-8") == page(whole)
    assert (tmp_path / "details.md").read_text(encoding="utf-8") == details(whole)
    assert imread(tmp_path / "ff6.png").shape[1] == 1200
    assert imread(tmp_path / "sweeps.png").shape[1] == 1440
    printed = invoke(*arguments).stdout
    for words in ("holds", "Its figures mean nothing"):
        assert words in printed


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("", encoding="utf-8")
    result = invoke("compare", "paper", "--out", tmp_path / "a")
    assert (result.exit_code, str(tmp_path / "a") in result.stderr) == (2, True)


class TestSensitivity:
    def test_a_number_is_changed_and_the_fall_is_straight_again(self) -> None:
        scenario = flown.M0_C2.load()
        own = scenario.plant
        found = changed(scenario, {"shank, side": 0.9, "roll damping": 1.1}).plant
        before, after = (plant.subject.suit.drag_areas_m2["shank"] for plant in (own, found))
        assert after == pytest.approx((before[0], 0.9 * before[1], before[2]))
        assert found.damping.Cm_damp_roll == pytest.approx(1.1 * own.damping.Cm_damp_roll)
        assert found.pattern == own.pattern
        assert found.initial.fall_speed_m_s > own.initial.fall_speed_m_s

    def test_each_number_alone_and_all_at_once(self) -> None:
        first, *others = calibrations().values()
        assert first == {}
        assert all(factor in (0.9, 1.1) for one in others if len(one) == 1 for factor in one.values())
        together = [one for one in others if len(one) > 1]
        assert all(0.9 <= factor <= 1.1 for one in together for factor in one.values())
        assert [one.keys() for one in together] == [NUMBERS.keys()] * 16

    @pytest.mark.parametrize(
        ("changes", "kept"),
        [
            ({}, [True, True, True, True]),
            ({"rmse": (3.0, 3.5, 4.5)}, [False, True, True, False]),
            ({"converged_s": (1.0, None, 1.0)}, [True, False, True, True]),
            ({"without_hands": (30.0, 5.0, 30.0)}, [True, True, False, True]),
        ],
    )
    def test_what_is_kept(self, changes: dict[str, Any], kept: list[bool]) -> None:
        thirty, one = (30.0, 30.0, 30.0), (1.0, 1.0, 1.0)
        good = Calibration(changed="", rmse=(3.0, 2.0, 1.0), without_hands=thirty, converged_s=one)
        assert list(good.replace(**changes).kept.values()) == kept


def test_a_hand_without_force_does_nothing_and_a_strong_one_more() -> None:
    """eq_force2 is linear in K_N; a small bank is nearly so."""
    idle, weak, strong = (
        hand_push(case(flown.UNKNOWN, ("plant.hands.K_N", force))) for force in (0.0, 5.0, 10.0)
    )
    assert idle == HandPush(bank_right_deg=0.0, yaw_rate_deg_s=0.0)
    assert strong.bank_right_deg == pytest.approx(2.0 * weak.bank_right_deg, rel=0.05)
    assert strong.bank_right_deg < 0.0  # a ventral force: the left side goes down


def test_the_telemetry_figure_shows_each_flight() -> None:
    settings = {"duration_s": 2.2}
    runs = {
        label: simulate(load_scenario("fast_turn_pi_dynamics", settings | {"controller.P_err": value}))
        for label, value in (("small", 1e-4), ("large", 1.0))
    }
    figure = telemetry_figure("Two flights", runs)
    assert [axes.get_title().splitlines()[0] for axes in figure.axes[:2]] == ["small", "large"]
    innovation = runs["large"].telemetry_names.index("innovation_yaw_rate")
    drawn = np.asarray(figure.axes[3].lines[0].get_ydata())
    np.testing.assert_array_equal(drawn, np.rad2deg(runs["large"].telemetry[:, innovation]))
    np.testing.assert_array_equal(figure.axes[8].images[0].get_array()[0], runs["small"].status)
