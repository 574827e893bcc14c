# SPDX-License-Identifier: Apache-2.0
"""Metrics of synthetic runs against values computed by hand."""

import json
import math

import numpy as np
import pytest
from runs import cart, rotation, run_of, skydiver

from skydiver_utc.analysis.labels import label_of, missing, rows
from skydiver_utc.analysis.metrics import metrics, to_json
from skydiver_utc.analysis.numbers import first_step_from
from skydiver_utc.controllers.protocol import Status
from skydiver_utc.loop.outcome import Outcome

OF_ANY_PLANT = {
    *("schema_version", "scenario", "outcome", "reason", "outputs", "rmse_deg_s", "max_abs_error_deg_s"),
    *("convergence_time_s", "control_effort", "status_steps", "diverged_points", "solve_time_us"),
    *("wall_time_s", "simulated_time_s", "missing_steps", "begins_at_s", "holes_s", "parameter_changes"),
}
OF_SKYDIVERS = {
    *("peak_yaw_rate_deg_s", "rmse_rotating_deg_s", "angle_error_deg", "overshoot_deg"),
    *("facing", "facing_since_s", "min_dorsal_axis"),
}


def test_a_plant_and_a_skydiver_have_their_own_keys_and_rows() -> None:
    skydivers, carts = metrics(run_of()), metrics(run_of(scenario=cart()))
    assert set(carts) == OF_ANY_PLANT
    assert set(skydivers) == OF_ANY_PLANT | OF_SKYDIVERS
    labels = [row.label for row in rows(carts)]
    assert any(label.startswith("place: ") for label in labels)
    assert not any("dorsal" in label for label in labels)
    assert [skydivers[key] for key in ("wall_time_s", "simulated_time_s", "control_effort")] == [
        0.5,
        4.0,
        0.0,
    ]
    assert skydivers["min_dorsal_axis"] == 1.0


def test_each_tracked_output_of_any_plant_has_its_own_figures() -> None:
    """81 states at 0.05 s; the place is 0.2 m short until 3 s, the speed 3 m/s off in one state after 2 s."""
    run = run_of(scenario=cart())
    run.reference[:, 0], run.states[:, 0] = 2.0, 2.0
    run.states[:60, 0] = 1.8
    run.states[50, 1] = -3.0
    found = metrics(run)
    assert found["outputs"]["place"] == {
        "unit": "1",
        "rmse": pytest.approx(0.2 * math.sqrt(20 / 41)),
        "max_abs_error": pytest.approx(0.2),
        "convergence_time_s": 3.0,
        "peak": 2.0,
    }
    assert found["outputs"]["speed"]["max_abs_error"] == 3.0
    assert found["outputs"]["speed"]["convergence_time_s"] is None  # 5 % of an amplitude of zero is no band
    assert (found["rmse_deg_s"], found["convergence_time_s"]) == (None, 3.0)


def test_errors_count_from_two_seconds_on() -> None:
    # Step 40 is 2 s. Of the 41 states counted, 20 are off by 3 and one by -30 deg/s.
    rate = np.full(81, 100.0)
    rate[39], rate[40:60], rate[60] = 500.0, 103.0, 70.0
    result = metrics(run_of(rate))
    assert result["rmse_deg_s"] == pytest.approx(math.sqrt((20 * 9 + 900) / 41))
    assert result["outputs"]["yaw_rate"]["rmse"] == pytest.approx(np.deg2rad(result["rmse_deg_s"]))
    assert result["outputs"]["yaw_rate"]["unit"] == "rad/s"
    assert result["max_abs_error_deg_s"] == pytest.approx(30.0)
    assert result["peak_yaw_rate_deg_s"] == pytest.approx(103.0)


@pytest.mark.parametrize(
    ("last_outside", "expected"), [(None, 0.0), (0, 0.05), (19, 1.0), (79, 4.0), (80, None)]
)
def test_convergence_is_the_step_after_the_last_one_outside_the_band(
    last_outside: int | None, expected: float | None
) -> None:
    rate = np.full(81, 104.9)
    if last_outside is not None:
        rate[last_outside] = 105.1
    assert metrics(run_of(rate))["convergence_time_s"] == expected


def test_the_band_is_that_of_the_amplitude() -> None:
    sine = {"kind": "sine", "output": "yaw_rate", "amplitude_deg_s": -400.0, "frequency_hz": 0.25}
    scenario = skydiver(reference=sine)
    reference = -400.0 * np.sin(np.pi / 2 * 0.05 * np.arange(81))
    inside, outside = (metrics(run_of(reference + off, reference, scenario)) for off in (19.9, 20.1))
    assert (inside["convergence_time_s"], outside["convergence_time_s"]) == (0.0, None)


def test_effort_scales_each_control_by_its_range_and_starts_at_the_initial_control() -> None:
    # Initial control (1, 0, 0, 0), ranges (4, 2, 2, 2). Half of the time Cm_damp_yaw is 3 and alpha -1.
    applied = np.tile([1.0, 0.0, 0.0, 0.0], (80, 1))
    applied[40:] = [3.0, 0.0, 0.0, -1.0]
    run = run_of(applied=applied, commands=np.full((80, 4), 9.0))
    assert metrics(run)["control_effort"] == pytest.approx(0.5 * (0.5**2 + 0.5**2))


def test_statuses_and_solve_times_are_of_the_calls_that_are_known() -> None:
    times = np.append(np.arange(1.0, 80.0) * 1e-6, np.nan)
    result = metrics(run_of(solve_time_s=times, status=np.repeat([0.0, 2.0, 3.0, np.nan], [50, 20, 3, 7])))
    counts = {name: count for name, count in result["status_steps"].items() if count}
    assert counts == {"solved": 50, "repaired": 20, "kept_previous": 3}
    assert result["solve_time_us"] == pytest.approx({"median": 40.0, "p99": 78.22})
    unknown = metrics(run_of(solve_time_s=np.full(80, np.nan)))
    assert unknown["solve_time_us"] == {"median": None, "p99": None}


def test_two_seconds_that_are_no_whole_number_of_steps() -> None:
    assert first_step_from(2.0, skydiver(dt_s=0.0042)) == 477  # 476 steps are 1.9992 s
    assert first_step_from(2.0, skydiver(dt_s=0.004)) == 500


@pytest.mark.parametrize(
    ("steps", "outcome", "rmse"),
    [
        *((steps, Outcome.ABORTED, None) for steps in (0, 1, 39)),  # shorter than two seconds
        *((60, outcome, pytest.approx(1.0)) for outcome in (Outcome.ABORTED, Outcome.NO_COMMAND)),
    ],
)
def test_a_run_cut_short_has_errors_from_two_seconds_on_but_no_convergence(
    steps: int, outcome: Outcome, rmse: object
) -> None:
    result = metrics(run_of(101.0, steps=steps, outcome=outcome))
    assert [result[key] for key in ("rmse_deg_s", "max_abs_error_deg_s")] == [rmse, rmse]
    assert (result["peak_yaw_rate_deg_s"] is None) == (rmse is None)
    assert result["convergence_time_s"] is None
    assert result["simulated_time_s"] == pytest.approx(steps * 0.05)
    json.loads(to_json(result))


@pytest.mark.parametrize("outcome", [Outcome.DIVERGED, Outcome.COMPLETED])
def test_nan_is_written_as_null(outcome: Outcome) -> None:
    rate = np.full(81, 100.0)
    rate[-1] = np.nan
    text = to_json(metrics(run_of(rate, outcome=outcome, wall_time_s=math.nan)))
    read = json.loads(text)
    assert "NaN" not in text
    errors = ("rmse_deg_s", "max_abs_error_deg_s", "peak_yaw_rate_deg_s")
    assert {read[key] for key in (*errors, "convergence_time_s", "wall_time_s")} == {None}
    with pytest.raises(ValueError, match="JSON"):
        to_json({"x": math.nan})


@pytest.mark.parametrize(
    ("bank_deg", "facing"),
    [
        *((bank_deg, "belly to earth") for bank_deg in (40.0, -40.0)),
        *((bank_deg, "neither") for bank_deg in (50.0, 90.0, -90.0, 130.0)),
        *((bank_deg, "back to earth") for bank_deg in (140.0, -140.0)),
    ],
)
def test_a_body_that_ends_on_its_side_faces_the_earth_with_neither(bank_deg: float, facing: str) -> None:
    """Belly and back within 45 deg; 60 steps of 0.05 s on the other side come before."""
    banks = np.full(81, 0.0 if facing == "back to earth" else 180.0)
    banks[60:] = bank_deg
    run, half = run_of(), np.deg2rad(banks) / 2
    run.states[:, 3:7] = np.stack([np.sin(half), 0 * half, 0 * half, np.cos(half)], axis=1)
    found = metrics(run)
    assert found["min_dorsal_axis"] == pytest.approx(np.cos(np.deg2rad(banks)).min(), abs=1e-12)
    assert found["facing"] == facing
    assert found["facing_since_s"] == (None if facing == "neither" else pytest.approx(3.0))


class TestRecordingOfTheRest:
    """Runs whose first steps are not recorded."""

    def test_figures_and_labels_are_of_the_recorded_steps(self) -> None:
        # Step 40 is 2 s, step 60 is 3 s. Inside 5 % of 100 deg/s from step 70 on.
        rate = np.full(81, 110.0)
        rate[70:] = 103.0
        whole = metrics(run_of(rate))
        early, late, settled = (metrics(run_of(rate).since(k)) for k in (20, 60, 75))
        assert (early["missing_steps"], early["begins_at_s"]) == (20, 1.0)
        for name in ("rmse_deg_s", "max_abs_error_deg_s", "convergence_time_s", "simulated_time_s"):
            assert early[name] == whole[name], name
        assert late["rmse_deg_s"] == pytest.approx(math.sqrt((10 * 100 + 11 * 9) / 21))
        assert late["convergence_time_s"] == pytest.approx(3.5)
        assert settled["convergence_time_s"] == settled["begins_at_s"] == pytest.approx(3.75)
        assert (settled["facing"], settled["facing_since_s"]) == ("belly to earth", pytest.approx(3.75))
        assert any("RMSE from 3 s on" in row.label for row in rows(late))
        assert any("RMSE from 2 s on" in row.label for row in rows(whole))
        assert ["latest" in row.label for row in rows(settled)].count(True) == 2
        assert not [row for row in rows(whole) if "latest" in row.label]
        assert "0 to 59" in missing(late)
        assert missing(whole) == ""

    def test_a_convergence_in_the_last_tenth_is_marked(self) -> None:
        for first, marked in ((70, 0), (75, 1)):  # at 3.5 and 3.75 of 4 s
            rate = np.full(81, 110.0)
            rate[first:] = 103.0
            found = [row for row in rows(metrics(run_of(rate))) if "chance" in row.label]
            assert len(found) == marked

    def test_an_angle_turned_is_not_known_without_the_beginning(self) -> None:
        rotating = skydiver(reference=rotation())
        whole, before, within = (metrics(run_of(100.0, 90.0, rotating).since(k)) for k in (0, 10, 30))
        assert whole["angle_error_deg"] is not None
        assert (before["angle_error_deg"], before["overshoot_deg"]) == (None, None)
        assert before["rmse_rotating_deg_s"] == whole["rmse_rotating_deg_s"] == pytest.approx(10.0)
        assert within["rmse_rotating_deg_s"] is None


def test_a_metric_has_the_label_of_its_row_and_its_unit() -> None:
    assert label_of("rmse_deg_s") == "RMSE from 2 s on [deg/s]"
    assert label_of("overshoot_deg") == "overshoot [deg]"
    assert label_of("control_effort") == "control effort [1]"
    assert label_of("convergence_time_s").endswith("[s]")
    assert label_of("own_metric") == "own_metric"


def test_what_the_controller_could_not_do_stands_in_the_reason() -> None:
    """80 steps: points diverge in 30 of them, the reference is out of reach in 20, an output is not moved in 10."""
    lost, status = np.zeros((80, 1)), np.zeros(80)
    lost[:30, 0], lost[3, 0] = 2.0, 8.0
    status[40:60], status[70:] = Status.NOT_REACHED, Status.NO_EFFECT
    result = metrics(run_of(telemetry=lost, telemetry_names=("diverged_points",), status=status))
    assert result["diverged_points"] == {"steps": 30, "largest": 8}
    for told in ("30 of 80", "up to 8", "20 of 80", "10 of 80"):
        assert told in result["reason"]
    quiet = run_of()
    assert metrics(quiet)["reason"] == quiet.reason
    assert metrics(quiet)["diverged_points"] == {"steps": 0, "largest": 0}
