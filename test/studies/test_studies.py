# SPDX-License-Identifier: Apache-2.0
"""Many runs for one question: which ones, what is kept, and the pages that are made of it."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.image import imread
from pinned import PINNED
from telemetry_figure import telemetry_figure
from tuning_guide import STEPS

from skydiver_utc.cli.main import main
from skydiver_utc.cli.settings import load as load_from_command_line
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.linear_loop import updated_control
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import ParameterError, leaves, load_scenario
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import Measures, case, measure, run_all
from skydiver_utc.studies.checklist import checklist
from skydiver_utc.studies.claim import Verdict, judge
from skydiver_utc.studies.linear_theory import of_linear_plant, report
from skydiver_utc.studies.markdown import figure
from skydiver_utc.studies.paper_files import read_comparison, to_json, write_comparison
from skydiver_utc.studies.paper_page import details, page
from skydiver_utc.studies.paper_results import HandPush, PaperResults, StepCost, hand_push, run_comparison
from skydiver_utc.studies.sensitivity import NUMBERS, Calibration, calibrations, changed
from skydiver_utc.studies.tuning import (
    FACTORS,
    Tuning,
    Tunings,
    check_tunable,
    draw,
    retuned,
    summarise,
)
from skydiver_utc.studies.tuning_files import table_file
from skydiver_utc.theory.riccati import Riccati, output_riccati

pytestmark = pytest.mark.long

PAPER = Path(__file__).resolve().parents[2] / "docs" / "paper"
# Rounding alone moves the RMSE of a flight of 20 s by 1 %: a start 1e-9 m/s faster does.
SAME_FLIGHT = 0.05


def measures(rmse: float | None = 3.0, **fields: object) -> Measures:
    """Measures with one number; whatever a test is not about is as in a good flight."""
    content = {
        "outcome": "completed",
        "rmse_deg_s": rmse,
        "max_abs_error_deg_s": 10.0,
        "convergence_time_s": 1.0,
        "peak_yaw_rate_deg_s": 400.0,
        "control_effort": 1.0,
        "min_dorsal_axis": 0.9,
        "angle_error_deg": None,
        "facing": "belly to earth",
        "hands_correlation": 0.0,
        "largest_speed_m_s": 60.0,
        "status_steps": {"solved": 0, "saturated": 0, "repaired": 100, "kept_previous": 0},
        "rescued_steps": 0,
    }
    return Measures.model_validate(content | fields)


def results_with(**rmse: float) -> PaperResults:
    """The shipped results with other flights' RMSE in the place of the named runs'."""
    results = read_comparison(PAPER)
    changed = {getattr(flown, name).command: value for name, value in rmse.items()}
    found = {
        command: one.replace(rmse_deg_s=changed.get(command, one.rmse_deg_s))
        for command, one in results.measures.items()
    }
    return results.replace(measures=found)


def verdict(results: PaperResults, words: str) -> Verdict:
    (found,) = (claim.verdict for claim in checklist(results) if words in claim.words)
    return found


class TestRuns:
    def test_a_command_can_be_typed(self) -> None:
        """What a page prints is what the command line reads: the same scenario comes of both."""
        kinds = {
            (one.scenario, tuple(name for name, _ in one.settings)): one for one in flown.all_cases().values()
        }
        for one in kinds.values():
            scenario, *settings = one.command.split(" --set ")
            assert load_from_command_line(scenario, settings) == one.load(), one.command

    def test_results_do_not_depend_on_the_number_of_processes(self) -> None:
        scenarios = {
            str(n): case("fast_turn_pi_dynamics", ("controller.horizon_steps", n)).load(2.5)
            for n in (2, 3, 4)
        }
        seen: list[int] = []
        alone = run_all(scenarios, measure, 1, seen.append)
        together = run_all(scenarios, measure, 2, seen.append)
        assert seen == [1, 2, 3, 1, 2, 3]
        assert list(together) == list(scenarios)
        assert alone == together
        assert len({one.rmse_deg_s for one in alone.values()}) == 3

    def test_an_error_in_a_process_comes_back(self) -> None:
        with pytest.raises(ZeroDivisionError):
            run_all({"a": case("bank_recovery").load(0.1)}, refuse, 2, lambda _count: None)


def refuse(_flight: object) -> None:
    raise ZeroDivisionError


class TestTuning:
    def test_factors_are_log_uniform_between_the_bounds(self) -> None:
        exponents = np.log10(draw(4000, 3, 10.0))
        assert exponents.shape == (4000, len(FACTORS))
        assert np.abs(exponents).max() <= 1.0 + 1e-3
        # Mean and variance of the uniform distribution on [-1, 1], within five standard errors.
        np.testing.assert_allclose(exponents.mean(axis=0), 0.0, atol=5 * np.sqrt(1 / 3 / 4000))
        np.testing.assert_allclose(exponents.var(axis=0), 1 / 3, atol=5 * np.sqrt(4 / 45 / 4000))
        assert np.abs(np.corrcoef(exponents.T) - np.eye(len(FACTORS))).max() < 5 / np.sqrt(4000)

    def test_a_seed_gives_its_draw_whatever_the_count(self) -> None:
        np.testing.assert_array_equal(draw(20, 7, 10.0)[:5], draw(5, 7, 10.0))
        assert not np.array_equal(draw(5, 7, 10.0), draw(5, 8, 10.0))

    def test_every_covariance_gets_its_own_factor_and_nothing_else_changes(self) -> None:
        scenario = load_scenario("fast_turn_unknown_dynamics")
        other = retuned(scenario, np.arange(2.0, 2.0 + len(FACTORS)).tolist())
        own = {leaf.name: leaf.value for leaf in leaves(scenario.controller)}
        changed = {leaf.name: leaf.value for leaf in leaves(other.controller)}
        for i, name in enumerate(FACTORS):
            assert changed.pop(name) == pytest.approx((2.0 + i) * float(own.pop(name)))  # type: ignore[arg-type]
        assert changed == own
        assert other.replace(controller=scenario.controller) == scenario

    def test_only_utc_has_covariances(self) -> None:
        with pytest.raises(ParameterError, match="fast_turn_pose_only"):
            check_tunable(load_scenario("fast_turn_pose_only"))

    def test_a_summary_counts_by_hand(self) -> None:
        """Eight tunings: RMSE falls with the first factor, the last three converge, one of them fast."""
        times = [None, None, None, 15.0, 19.0, 9.0, 5.0, 1.5]
        rows = [
            Tuning((float(i + 1), *([1.0 + (i % 3)] * 8)), measures(80.0 / (i + 1), convergence_time_s=time))
            for i, time in enumerate(times)
        ]
        rows[0] = rows[0]._replace(measures=measures(None, outcome="diverged", convergence_time_s=None))
        summary = summarise(Tunings(load_scenario("fast_turn_pi_dynamics"), 10.0, measures(15.0), rows))
        assert (summary.count, summary.completed) == (8, 7)
        assert (summary.converged, summary.converged_by_2_s) == (3, 1)
        assert summary.tracked == 5  # 20 deg/s and less
        assert summary.better_than_own == 3  # less than 15: 13.3, 11.4, 10
        assert summary.influence["Pu.Cm_damp_yaw"] == -1.0

    def test_the_sign_by_the_damping_is_insensitive_and_the_printed_one_is_not(self) -> None:
        """In the shipped study of 100 tunings each."""
        converged = {one.scenario: one.converged for one in read_comparison(PAPER).tuning}
        assert converged[f"{flown.UNKNOWN}_insensitive"] > 90 > 50 > converged[flown.UNKNOWN]


def measure_of(scenario: object) -> Measures:
    return run_all({"one": scenario}, measure, 1, lambda _count: None)["one"]  # type: ignore[dict-item]


class TestClaims:
    def test_all_parts_some_or_none(self) -> None:
        assert judge([True, True]) is Verdict.HOLDS
        assert judge([True, False]) is Verdict.PARTLY
        assert judge([False, False]) is Verdict.FAILS

    def test_the_printed_covariances_mean_nothing_but_their_signs_do(self) -> None:
        assert verdict(results_with(), "Convenient tuning") is Verdict.PARTLY
        results = read_comparison(PAPER)
        alike = {command: one.replace(hands_correlation=1.0) for command, one in results.measures.items()}
        same = results.replace(measures=alike)
        assert verdict(same, "Convenient tuning") is Verdict.FAILS

    def test_a_worse_flight_turns_a_verdict(self) -> None:
        assert verdict(results_with(), "the accuracy is better") is Verdict.HOLDS
        assert verdict(results_with(M1_C2=50.0), "the accuracy is better") is Verdict.FAILS
        assert verdict(results_with(M1_C2=3.0, M1_C3=2.0, M0_C2=4.0), "accurately tracks") is Verdict.HOLDS
        assert verdict(results_with(M1_C2=50.0), "accurately tracks") is Verdict.PARTLY
        assert verdict(results_with(), "need not be parameterised") is Verdict.HOLDS
        assert verdict(results_with(M1_C2=50.0), "need not be parameterised") is Verdict.PARTLY
        assert (
            verdict(results_with(M0_C2=3.0, M0_C3=4.0, M0_NONE=4.0), "With alpha unknown") is Verdict.PARTLY
        )
        assert verdict(results_with(M0_C2=3.0, M0_C3=2.0, M0_NONE=3.0), "With alpha unknown") is Verdict.FAILS

    def test_without_a_study_its_claim_is_not_decided(self) -> None:
        results = results_with().replace(tuning=())
        assert verdict(results, "Not much sensitivity") is Verdict.ELSEWHERE
        assert "study tuning" in page(results)
        assert "study sensitivity" in details(results.replace(sensitivity=()))

    def test_the_hands_are_needed_by_their_force_or_by_their_moment(self) -> None:
        force, moment = (flown.HANDS[name] for name in (flown.FORCE_ALONE, flown.MOMENT_ALONE))
        (own,) = (one.why for one in checklist(results_with()) if "input moments" in one.words)
        assert "airspeed" in own
        assert "not the bank" in own
        results = results_with()
        other = dict(zip([one.command for one in (*force, *moment)], [60.0] * 3 + [2.0] * 3, strict=True))
        changed = {k: m.replace(rmse_deg_s=other.get(k, m.rmse_deg_s)) for k, m in results.measures.items()}
        (why,) = (
            one.why for one in checklist(results.replace(measures=changed)) if "input moments" in one.words
        )
        assert "not the bank" not in why

    def test_effort_is_compared_with_what_tracks(self) -> None:
        def effort(m0_c3: float, converged_s: float) -> Verdict:
            results = results_with()
            found = {k: m.replace(control_effort=2.0) for k, m in results.measures.items()}
            found[flown.M1_C3.command] = found[flown.M1_C3.command].replace(control_effort=1.0)
            other = {"control_effort": m0_c3, "convergence_time_s": converged_s}
            found[flown.M0_C3.command] = found[flown.M0_C3.command].replace(**other)
            return verdict(results.replace(measures=found), "control effort is least")

        assert effort(1.1, 1.0) is Verdict.HOLDS
        assert effort(0.9, 1.0) is Verdict.FAILS
        assert effort(0.9, 19.0) is Verdict.HOLDS

    @pytest.mark.parametrize(
        ("cost", "expected"),
        [
            (None, Verdict.ELSEWHERE),
            (StepCost(held=1.5, every_step=20.0), Verdict.HOLDS),
            (StepCost(held=0.9, every_step=20.0), Verdict.PARTLY),
            (StepCost(held=0.9, every_step=0.8), Verdict.FAILS),
        ],
    )
    def test_the_cost_of_a_nonlinear_program(self, cost: StepCost | None, expected: Verdict) -> None:
        results = results_with().replace(cost=cost)
        assert verdict(results, "Propagating nine sigma points") is expected

    def test_the_closed_form_of_the_update_is_computed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert verdict(results_with(), "minimum mean square error") is Verdict.HOLDS

        def slightly_off(*given: Any) -> np.ndarray:
            return (1.0 + 1e-9) * updated_control(*given)

        monkeypatch.setattr("skydiver_utc.studies.claims_theory.updated_control", slightly_off)
        assert verdict(results_with(), "minimum mean square error") is Verdict.FAILS

    def test_what_does_not_hold_has_a_reason(self) -> None:
        for claim in checklist(results_with()):
            assert claim.why or claim.verdict is Verdict.HOLDS, claim.words

    def test_a_rescued_step_is_a_convergence_problem(self) -> None:
        results, words = results_with(), "no convergence problems"
        assert verdict(results, words) is Verdict.PARTLY
        without = {
            command: one.replace(rescued_steps=0, status_steps={"solved": sum(one.status_steps.values())})
            for command, one in results.measures.items()
        }
        assert verdict(results.replace(measures=without), words) is Verdict.HOLDS

    def test_the_riccati_form_is_computed_and_flown(self) -> None:
        assert verdict(results_with(), "For linear systems stability") is Verdict.HOLDS

    @pytest.mark.parametrize("steps", [1, 5])
    def test_the_decay_flown_is_what_the_command_prints(self, steps: int) -> None:
        printed = report(of_linear_plant("admire")._replace(horizon_steps=steps))
        (claim,) = [one for one in checklist(results_with()) if one.words.startswith("For linear systems")]
        assert f"{printed['decay']:.4f} computed, {printed['measured_decay']:.4f} flown" in claim.measured

    def test_without_the_additional_term_the_riccati_form_fails(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def without(*given: Any) -> Riccati:
            terms = output_riccati(*given)
            return terms._replace(additional=0.0 * terms.additional)

        monkeypatch.setattr("skydiver_utc.studies.claims_theory.output_riccati", without)
        assert verdict(results_with(), "For linear systems stability") is Verdict.PARTLY


class TestShippedPage:
    """docs/paper is what the command writes, and its figures are those of flights."""

    def test_the_page_is_made_from_the_results(self) -> None:
        results = read_comparison(PAPER)
        assert (PAPER / "paper.md").read_text(encoding="utf-8") == page(results)
        assert (PAPER / "details.md").read_text(encoding="utf-8") == details(results)

    def test_the_results_are_of_all_flights_in_full(self) -> None:
        results = read_comparison(PAPER)
        assert not results.quick
        assert list(results.measures) == list(flown.all_cases())

    def test_every_picture_that_the_page_shows_is_there(self) -> None:
        text = "".join((PAPER / name).read_text(encoding="utf-8") for name in ("paper.md", "details.md"))
        shown = {part.partition(")")[0] for part in text.split("](")[1:]}
        assert {name for name in shown if name.endswith(".png")} >= {
            f"{label}.png" for label in flown.FIGURES
        }
        assert all((PAPER / name).is_file() for name in shown)

    def test_its_figures_are_those_of_the_scenarios(self) -> None:
        shown = {name: one for name, one in read_comparison(PAPER).measures.items() if name in PINNED}
        assert len(shown) > 5
        for name, shipped in shown.items():
            assert shipped.outcome == PINNED[name]["outcome"]
            for key in ("rmse_deg_s", "max_abs_error_deg_s", "control_effort", "peak_yaw_rate_deg_s"):
                assert getattr(shipped, key) == pytest.approx(PINNED[name][key], rel=SAME_FLIGHT), (name, key)

    def test_a_flight_with_other_settings_flies_again(self) -> None:
        one = flown.VARIANTS[2].flown
        assert one is not None
        shipped, now = read_comparison(PAPER).of(one), measure_of(one.load())
        assert now.outcome == shipped.outcome
        assert now.rmse == pytest.approx(shipped.rmse, rel=SAME_FLIGHT)

    def test_a_random_tuning_flies_again_as_its_row_says(self) -> None:
        name = f"{flown.UNKNOWN}_insensitive"
        with (PAPER / table_file(name, 3.0)).open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        factors = [[float(row[factor]) for factor in FACTORS] for row in rows]
        np.testing.assert_array_equal(factors, draw(len(rows), 1, 3.0))
        now = measure_of(retuned(load_scenario(name), factors[0]))
        assert now.rmse == pytest.approx(float(rows[0]["rmse_deg_s"]), rel=SAME_FLIGHT)

    def test_the_summary_is_that_of_the_rows(self) -> None:
        for summary in read_comparison(PAPER).tuning:
            with (PAPER / table_file(summary.scenario, summary.reach)).open(encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
            rmse = [float(row["rmse_deg_s"]) for row in rows]
            assert summary.count == len(rows) >= 100
            assert summary.tracked == sum(value <= 20.0 for value in rmse)
            assert summary.rmse_quantiles[1] == pytest.approx(sorted(rmse)[(len(rmse) - 1) // 2], rel=1e-3)
            times = [float(row["convergence_time_s"] or "inf") for row in rows]
            assert summary.converged == sum(time <= 10.0 for time in times)


def test_the_readme_has_the_pinned_figures() -> None:
    text = (PAPER.parents[1] / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)`[^|]*\| ([\d.]+)", text, re.MULTILINE)
    assert len(rows) > 1
    for name, printed in rows:
        assert float(printed) == pytest.approx(PINNED[name]["rmse_deg_s"], rel=SAME_FLIGHT), name


def test_results_survive_their_file() -> None:
    results = read_comparison(PAPER)
    assert PaperResults.model_validate_json(to_json(results)) == results.replace(tuning=(), sensitivity=())
    assert json.loads(to_json(results))["schema_version"] == 2


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (float("inf"), "-"),
        (138.4, "138"),
        (9.96, "10"),
        (9.94, "9.9"),
        (-0.84, "-0.84"),
        (0.996, "1.0"),
    ],
)
def test_figures_have_two_digits_or_are_whole(value: float | None, text: str) -> None:
    assert figure(value) == text


def test_every_flight_of_the_tuning_guide_loads_and_is_shown_in_it() -> None:
    text = (PAPER.parent / "tuning-skydiver.md").read_text(encoding="utf-8")
    for step in STEPS:
        assert f"figures/tuning/{step.name}.png" in text
        assert (PAPER.parent / "figures" / "tuning" / f"{step.name}.png").is_file()
        for one in step.cases.values():
            assert isinstance(one.load().controller, UtcSettings)


def a_flight() -> Run:
    return simulate(load_scenario("fast_turn_pose_only", {"duration_s": 2.2}))


class TestFiles:
    def test_a_comparison_writes_what_its_page_shows(self, tmp_path: Path) -> None:
        results = results_with().replace(tuning=(), sensitivity=())
        write_comparison(tmp_path, results, {"ff6": a_flight()})
        assert read_comparison(tmp_path) == results
        assert (tmp_path / "paper.md").read_text(encoding="utf-8") == page(results)
        assert imread(tmp_path / "ff6.png").shape[1] == 1200
        assert imread(tmp_path / "sweeps.png").shape[1] == 1440

    def test_a_study_found_beside_it_goes_into_the_page(self, tmp_path: Path) -> None:
        (tmp_path / "tuning.json").write_bytes((PAPER / "tuning.json").read_bytes())
        write_comparison(tmp_path, results_with().replace(tuning=(), sensitivity=()), {})
        assert read_comparison(tmp_path) == results_with().replace(sensitivity=())
        assert "tuning.png" in (tmp_path / "details.md").read_text(encoding="utf-8")


class TestCommands:
    def call(self, *arguments: str) -> str:
        result = CliRunner().invoke(main, arguments, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.stdout

    def test_a_short_tuning_study_and_its_table(self, tmp_path: Path) -> None:
        flight = {"duration_s": 2.2, "controller.horizon_steps": 2}
        name, seed = "fast_turn_pi_dynamics", 3
        arguments = [
            "study",
            "tuning",
            "--scenario",
            name,
            "--factor",
            "2",
            "--workers",
            "1",
            "--seed",
            str(seed),
        ]
        arguments += [word for setting in flight.items() for word in ("--set", "{}={}".format(*setting))]
        made = self.call(*arguments, "--count", "3", "--out", str(tmp_path / "new"), "--json")
        found = json.loads(made)
        assert [(one["count"], one["completed"], one["reach"]) for one in found] == [(3, 3, 2.0)]
        assert json.loads((tmp_path / "new" / "tuning.json").read_text(encoding="utf-8")) == found
        assert imread(tmp_path / "new" / "tuning.png").shape[1] == 1125
        table = list(csv.DictReader((tmp_path / "new" / table_file(name, 2.0)).open(encoding="utf-8")))
        factors = [[float(row[factor]) for factor in FACTORS] for row in table]
        np.testing.assert_array_equal(factors, draw(3, seed, 2.0))
        again = measure_of(retuned(load_scenario(name, flight), factors[1]))
        assert again.rmse == pytest.approx(float(table[1]["rmse_deg_s"]), rel=1e-3)
        assert "RMSE of the scenario's own tuning" in self.call(*arguments, "--count", "2")

    def test_compare_shows_and_writes_the_same(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        results = results_with().replace(tuning=(), sensitivity=())
        asked = []

        def no_flight(quick: bool, workers: int, _done: object) -> tuple[PaperResults, dict[str, Run]]:
            asked.append((quick, workers))
            return results, {}

        monkeypatch.setattr("skydiver_utc.studies.paper_results.run_comparison", no_flight)
        shown = json.loads(self.call("compare", "paper", "--quick", "--workers", "3", "--json"))
        assert asked == [(True, 3)]
        assert len(shown["claims"]) == len(checklist(results))
        assert shown["measures"] == json.loads(to_json(results))["measures"]
        text = self.call("compare", "paper", "--out", str(tmp_path))
        assert "partly" in text
        assert (tmp_path / "results.json").is_file()
        assert "Its figures mean nothing" not in text
        results = results.replace(quick=True)
        text = self.call("compare", "paper", "--quick", "--out", str(tmp_path))
        assert "only the first 5 s of each run. Its figures mean nothing." in text
        assert "Its figures mean nothing" in (tmp_path / "paper.md").read_text(encoding="utf-8")

    def test_a_file_is_no_folder(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("", encoding="utf-8")
        result = CliRunner().invoke(main, ["compare", "paper", "--out", str(tmp_path / "a")])
        assert result.exit_code == 2
        assert str(tmp_path / "a") in result.output


def test_the_quick_comparison_flies_everything_but_shortly(monkeypatch: pytest.MonkeyPatch) -> None:
    few = {one.command: one for one in (*flown.FIGURES.values(), flown.M0_SHORT)}
    monkeypatch.setattr("skydiver_utc.studies.paper_results.all_cases", lambda: few)
    monkeypatch.setattr("skydiver_utc.studies.paper_results.QUICK_S", 2.1)
    seen: list[int] = []
    results, flights = run_comparison(quick=True, workers=1, done=seen.append)
    assert seen == [1, 2, 3, 4, 5]
    assert list(results.measures) == list(few)
    assert list(flights) == list(flown.FIGURES)
    assert {len(flight.states) for flight in flights.values()} == {501}
    assert results.of(flown.M1_C2) == measure(flights["utc_m1_c2"])
    assert results.quick
    assert results.cost is not None
    assert min(results.cost.held, results.cost.every_step) > 0.0


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
        found = list(calibrations().values())
        assert found[0] == {}
        assert all(factor in (0.9, 1.1) for one in found[1:] if len(one) == 1 for factor in one.values())
        together = [one for one in found if len(one) > 1]
        assert all(0.9 <= factor <= 1.1 for one in together for factor in one.values())
        assert len(together) == 16
        assert all(one.keys() == NUMBERS.keys() for one in together)

    def test_what_is_kept(self) -> None:
        good = Calibration(
            changed="", rmse=(3.0, 2.0, 1.0), without_hands=(30.0, 30.0, 30.0), converged_s=(1.0, 1.0, 1.0)
        )
        assert all(good.kept.values())
        assert list(good.replace(rmse=(3.0, 3.5, 4.5)).kept.values()) == [False, True, True, False]
        assert list(good.replace(converged_s=(1.0, None, 1.0)).kept.values()) == [True, False, True, True]
        assert list(good.replace(without_hands=(30.0, 5.0, 30.0)).kept.values()) == [True, True, False, True]


def test_a_hand_without_force_does_nothing_and_a_strong_one_more() -> None:
    """eq_force2 is linear in K_N; a small bank is nearly so."""
    idle, weak, strong = (
        hand_push(case(flown.UNKNOWN, ("plant.hands.K_N", force))) for force in (0.0, 5.0, 10.0)
    )
    assert idle == HandPush(bank_right_deg=0.0, yaw_rate_deg_s=0.0)
    assert strong.bank_right_deg == pytest.approx(2.0 * weak.bank_right_deg, rel=0.05)
    assert strong.bank_right_deg < 0.0  # a ventral force: the left side goes down


def test_the_telemetry_figure_shows_each_flight() -> None:
    flights = {
        label: simulate(
            load_scenario("fast_turn_pi_dynamics", {"duration_s": 2.2, "controller.P_err": value})
        )
        for label, value in (("small", 1e-4), ("large", 1.0))
    }
    figure = telemetry_figure("Two flights", flights)
    assert [axes.get_title().splitlines()[0] for axes in figure.axes[:2]] == ["small", "large"]
    innovation = flights["large"].telemetry_names.index("innovation_yaw_rate")
    drawn = np.asarray(figure.axes[3].lines[0].get_ydata())
    np.testing.assert_array_equal(drawn, np.rad2deg(flights["large"].telemetry[:, innovation]))
    np.testing.assert_array_equal(figure.axes[8].images[0].get_array()[0], flights["small"].status)
