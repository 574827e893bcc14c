"""Metrics of synthetic flights against values computed by hand."""

import json
import math
from typing import Any

import msgspec
import numpy as np
import pytest

from skydiver_utc.analysis.labels import missing, rows
from skydiver_utc.analysis.metrics import first_step_from, metrics, to_json
from skydiver_utc.parameters import RotationReference, Scenario
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import Outcome

KEYS = [
    "schema_version",
    "scenario",
    "outcome",
    "reason",
    "rmse_deg_s",
    "max_abs_error_deg_s",
    "convergence_time_s",
    "peak_yaw_rate_deg_s",
    "rmse_rotating_deg_s",
    "angle_error_deg",
    "overshoot_deg",
    "control_effort",
    "status_steps",
    "solve_time_us",
    "wall_time_s",
    "simulated_time_s",
    "facing",
    "facing_since_s",
    "min_dorsal_axis",
    "missing_steps",
    "begins_at_s",
    "parameter_changes",
]


def scenario_of(duration_s: float = 4.0, dt_s: float = 0.05, **reference: Any) -> Scenario:
    """A scenario whose numbers are all written here; the reference defaults to a constant 100 deg/s."""
    table = {"name": "t", "source": "t", "reference_mass_kg": 70, "reference_height_m": 1.7}
    segments = table | {
        "shoulder_to_hip_mm": 500,
        "shoulder_offset_mm": 200,
        "hip_offset_mm": 90,
        "offsets_source": "t",
        "segments": {},
    }
    limits = {"Cm_damp_yaw": [0.0, 4.0], "k_right": [-1.0, 1.0], "k_left": [-1.0, 1.0], "alpha": [-1.0, 1.0]}
    content = {
        "name": "synthetic",
        "title": "Synthetic flight",
        "duration_s": duration_s,
        "dt_s": dt_s,
        "epoch_s": 1_700_000_000,
        "air": {"density_kg_m3": 1.0},
        "plant": {
            "damping": {
                "Cm_damp_roll": 1.0,
                "Cm_damp_pitch": 1.0,
                "reference_area_m2": 1.0,
                "reference_length_m": 1.0,
            },
            "hands": {"K_N": 10.0, "lx_m": 0.35},
            "limits": limits | {"alpha_rate": 2.0},
            "limbs": {"reaction": False, "alpha_acceleration": 100.0},
        },
        "initial": {"altitude_m": 4000, "fall_speed_m_s": 60.0, "Cm_damp_yaw": 1.0},
        "reference": reference or {"kind": "constant", "yaw_rate_deg_s": 100.0},
        "controller": {"kind": "pose"},
        "subject": {
            "name": "t",
            "mass_kg": 70,
            "height_m": 1.7,
            "segments": segments,
            "suit": table | {"drag_areas_m2": {}},
            "joint_limits": {"name": "t", "source": "t", "ranges_deg": {}},
        },
        "posture": {"name": "t", "description": "t", "source": "t", "joint_angles_deg": {}},
        "pattern": {
            "kind": "direction",
            "name": "t",
            "description": "t",
            "source": "t",
            "components": {"hip": [1.0, 0.0, 0.0]},
        },
    }
    return msgspec.convert(content, Scenario)


def flight_of(
    yaw_rate_deg_s: Any = 100.0,
    reference_deg_s: Any = 100.0,
    scenario: Scenario | None = None,
    steps: int | None = None,
    **fields: Any,
) -> Flight:
    """A level flight with the given yaw rate and reference (numbers or arrays of K + 1 values)."""
    scenario = scenario or scenario_of()
    steps = scenario.steps if steps is None else steps
    states = np.zeros((steps + 1, 13))
    states[:, 6] = 1.0
    states[:, 12] = np.deg2rad(yaw_rate_deg_s)
    controls = np.tile([1.0, 0.0, 0.0, 0.0], (steps, 1))
    flight = {
        "scenario": scenario,
        "states": states,
        "commands": controls,
        "applied": controls,
        "reference": np.deg2rad(np.broadcast_to(reference_deg_s, steps + 1)),
        "telemetry": np.zeros((steps, 0)),
        "telemetry_names": (),
        "solve_time_s": np.full(steps, 20e-6),
        "status": np.zeros(steps),
        "outcome": Outcome.COMPLETED,
        "reason": "80 steps flown",
        "wall_time_s": 0.5,
    }
    return Flight(**(flight | fields))


def test_keys_stand_in_the_order_of_the_definition() -> None:
    assert list(metrics(flight_of())) == KEYS


def test_perfect_tracking() -> None:
    result = metrics(flight_of())
    assert result["rmse_deg_s"] == pytest.approx(0.0, abs=1e-12)
    assert result["convergence_time_s"] == 0.0
    assert result["peak_yaw_rate_deg_s"] == pytest.approx(100.0)
    assert result["control_effort"] == 0.0
    assert result["min_dorsal_axis"] == 1.0
    assert (result["wall_time_s"], result["simulated_time_s"]) == (0.5, 4.0)


def late_flight(first_step: int, *arguments: Any, **fields: Any) -> Flight:
    """A flight of 80 steps whose recording lacks those before this one."""
    flight = flight_of(*arguments, **fields)
    return flight.since(first_step)


def test_a_recording_of_the_rest_of_a_flight_is_measured_from_where_it_begins() -> None:
    # 81 states at 0.05 s; step 40 is 2 s, step 60 is 3 s. Inside 5 % of 100 deg/s from step 70 on.
    rate = np.full(81, 110.0)
    rate[70:] = 103.0
    early, late, settled = (metrics(late_flight(k, rate)) for k in (20, 60, 75))
    whole = metrics(flight_of(rate))
    assert (early["missing_steps"], early["begins_at_s"]) == (20, 1.0)
    for name in ("rmse_deg_s", "max_abs_error_deg_s", "convergence_time_s", "simulated_time_s"):
        assert early[name] == whole[name], name
    assert late["rmse_deg_s"] == pytest.approx(math.sqrt((10 * 100 + 11 * 9) / 21))
    assert late["convergence_time_s"] == pytest.approx(3.5)
    assert settled["convergence_time_s"] == settled["begins_at_s"] == pytest.approx(3.75)
    assert (settled["facing"], settled["facing_since_s"]) == ("belly to earth", pytest.approx(3.75))


def test_a_flight_since_a_step_is_the_rest_of_it() -> None:
    whole = flight_of(np.arange(81.0))
    rest = whole.since(30)
    assert rest.states.tolist() == whole.states[30:].tolist()
    assert rest.time_s.tolist() == whole.time_s[30:].tolist()
    assert rest.since(40).states.tolist() == whole.states[40:].tolist()
    assert rest.since(40).first_step == 40


def test_labels_say_from_when_on_and_what_is_missing() -> None:
    rate = np.full(81, 110.0)
    rate[70:] = 103.0
    whole, late, settled = (metrics(late_flight(k, rate)) for k in (0, 60, 75))
    labels = [row.label for row in rows(late)]
    assert "RMSE from 3 s on" in labels
    assert "inside 5 % for good from" in labels
    assert "RMSE from 2 s on" in [row.label for row in rows(whole)]
    assert "inside 5 % for good from (at the latest)" in [row.label for row in rows(settled)]
    assert missing(late).startswith("steps 0 to 59 are not in the recording, it begins at 3.000 s")
    assert missing(whole) == ""
    assert not [row.label for row in rows(whole) if "latest" in row.label]


def test_an_angle_turned_is_not_told_without_the_beginning() -> None:
    rotation = RotationReference(angle_deg=180.0, start_s=1.0, duration_s=2.0)
    rotating = msgspec.structs.replace(scenario_of(), reference=rotation)
    whole, before, within = (metrics(late_flight(k, 100.0, 90.0, scenario=rotating)) for k in (0, 10, 30))
    assert whole["angle_error_deg"] is not None
    assert (before["angle_error_deg"], before["overshoot_deg"]) == (None, None)
    assert before["rmse_rotating_deg_s"] == whole["rmse_rotating_deg_s"] == pytest.approx(10.0)
    assert within["rmse_rotating_deg_s"] is None


def test_statuses_are_counted_by_name() -> None:
    result = metrics(flight_of(status=np.repeat([0.0, 2.0, 3.0, np.nan], [50, 20, 3, 7])))
    assert result["status_steps"] == {"solved": 50, "saturated": 0, "repaired": 20, "kept_previous": 3}


def test_errors_count_from_two_seconds_on() -> None:
    # 81 states at 0.05 s; step 40 is 2 s. Of the 41 counted, 20 are off by 3 and one by -30 deg/s.
    rate = np.full(81, 100.0)
    rate[39] = 500.0
    rate[40:60] = 103.0
    rate[60] = 70.0
    result = metrics(flight_of(rate))
    assert result["rmse_deg_s"] == pytest.approx(math.sqrt((20 * 9 + 900) / 41))
    assert result["max_abs_error_deg_s"] == pytest.approx(30.0)
    assert result["peak_yaw_rate_deg_s"] == pytest.approx(103.0)


def test_peak_is_of_the_absolute_yaw_rate() -> None:
    rate = np.full(81, 100.0)
    rate[50] = -250.0
    assert metrics(flight_of(rate))["peak_yaw_rate_deg_s"] == pytest.approx(250.0)


@pytest.mark.parametrize(
    ("last_outside", "expected"),
    [(None, 0.0), (0, 0.05), (19, 1.0), (79, 4.0), (80, None)],
)
def test_convergence_is_the_step_after_the_last_one_outside_the_band(
    last_outside: int | None, expected: float | None
) -> None:
    rate = np.full(81, 104.9)
    if last_outside is not None:
        rate[last_outside] = 105.1
    assert metrics(flight_of(rate))["convergence_time_s"] == expected


def test_the_band_is_that_of_the_amplitude_not_of_the_reference_now() -> None:
    scenario = scenario_of(kind="sine", amplitude_deg_s=-400.0, frequency_hz=0.25)
    reference = -400.0 * np.sin(np.pi / 2 * 0.05 * np.arange(81))
    inside = metrics(flight_of(reference + 19.9, reference, scenario))
    outside = metrics(flight_of(reference + 20.1, reference, scenario))
    assert (inside["convergence_time_s"], outside["convergence_time_s"]) == (0.0, None)


def test_a_zero_reference_has_no_band() -> None:
    scenario = scenario_of(kind="constant", yaw_rate_deg_s=0.0)
    result = metrics(flight_of(0.0, 0.0, scenario))
    assert result["convergence_time_s"] is None
    assert result["rmse_deg_s"] == 0.0


def test_effort_scales_each_control_by_its_range_and_starts_at_the_initial_control() -> None:
    # Initial control (1, 0, 0, 0), ranges (4, 2, 2, 2). Half of the time Cm_damp_yaw is 3 and alpha -1.
    applied = np.tile([1.0, 0.0, 0.0, 0.0], (80, 1))
    applied[40:] = [3.0, 0.0, 0.0, -1.0]
    asked = np.full((80, 4), 9.0)
    assert metrics(flight_of(applied=applied, commands=asked))["control_effort"] == pytest.approx(
        0.5 * (0.5**2 + 0.5**2)
    )


def test_solve_times_are_of_the_calls_that_are_known() -> None:
    times = np.arange(1.0, 102.0) * 1e-6
    result = metrics(flight_of(solve_time_s=np.append(times, np.nan)))
    assert result["solve_time_us"] == pytest.approx({"median": 51.0, "p99": 100.0})
    unknown = metrics(flight_of(solve_time_s=np.full(80, np.nan)))
    assert unknown["solve_time_us"] == {"median": None, "p99": None}


def test_two_seconds_that_are_no_whole_number_of_steps() -> None:
    assert first_step_from(2.0, scenario_of(dt_s=0.0042)) == 477  # 476 steps are 1.9992 s
    assert first_step_from(2.0, scenario_of(dt_s=0.004)) == 500


@pytest.mark.parametrize("steps", [0, 1, 39])
def test_a_flight_shorter_than_two_seconds_has_no_errors(steps: int) -> None:
    result = metrics(flight_of(steps=steps, outcome=Outcome.ABORTED))
    assert [result[key] for key in ("rmse_deg_s", "max_abs_error_deg_s", "peak_yaw_rate_deg_s")] == [None] * 3
    assert result["simulated_time_s"] == pytest.approx(steps * 0.05)
    json.loads(to_json(result))


def test_a_diverged_flight_writes_null_and_never_nan() -> None:
    rate = np.full(81, 100.0)
    rate[-1] = np.nan
    result = metrics(flight_of(rate, outcome=Outcome.DIVERGED, wall_time_s=math.nan))
    text = to_json(result)
    assert "NaN" not in text
    assert "Infinity" not in text
    read = json.loads(text)
    for key in (
        "rmse_deg_s",
        "max_abs_error_deg_s",
        "convergence_time_s",
        "peak_yaw_rate_deg_s",
        "wall_time_s",
    ):
        assert read[key] is None


@pytest.mark.parametrize("outcome", [Outcome.ABORTED, Outcome.NO_COMMAND])
def test_a_flight_cut_short_has_errors_but_no_convergence(outcome: Outcome) -> None:
    result = metrics(flight_of(101.0, steps=60, outcome=outcome))
    assert result["rmse_deg_s"] == pytest.approx(1.0)
    assert result["convergence_time_s"] is None


def test_nan_in_a_flight_said_to_be_complete_is_null_too() -> None:
    flight = flight_of(np.full(81, np.nan))
    assert metrics(flight)["rmse_deg_s"] is None
    assert metrics(flight)["convergence_time_s"] is None
    json.loads(to_json(metrics(flight)))


def test_the_lowest_dorsal_axis_of_a_body_on_its_side() -> None:
    flight = flight_of()
    flight.states[30, 3:7] = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
    assert metrics(flight)["min_dorsal_axis"] == pytest.approx(0.0, abs=1e-12)


def test_a_nan_is_refused_by_the_writer() -> None:
    with pytest.raises(ValueError, match="JSON compliant"):
        to_json({"x": math.nan})
