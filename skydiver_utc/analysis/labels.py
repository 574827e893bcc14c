"""Metrics as people read them: label, number and unit."""

from typing import Any, NamedTuple

from skydiver_utc.analysis.metrics import SETTLING_S

# In a label SINCE is the time from which on the errors count.
_ROWS = (
    ("rmse_deg_s", "RMSE from SINCE on", "deg/s", ".2f"),
    ("max_abs_error_deg_s", "largest error from SINCE on", "deg/s", ".2f"),
    ("convergence_time_s", "inside 5 % for good from", "s", ".2f"),
    ("peak_yaw_rate_deg_s", "peak yaw rate from SINCE on", "deg/s", ".1f"),
    ("rmse_rotating_deg_s", "RMSE while it is to turn", "deg/s", ".2f"),
    ("angle_error_deg", "angle turned less wanted", "deg", ".1f"),
    ("overshoot_deg", "overshoot", "deg", ".1f"),
    ("facing", "at the end", "", ""),
    ("facing_since_s", "so since", "s", ".2f"),
    ("control_effort", "control effort", "", ".4f"),
    ("min_dorsal_axis", "lowest dorsal axis", "", ".3f"),
    ("solve_time_us.median", "controller call, median", "us", ".1f"),
    ("solve_time_us.p99", "controller call, 99th percentile", "us", ".1f"),
    ("simulated_time_s", "simulated time", "s", ".2f"),
    ("wall_time_s", "wall time", "s", ".2f"),
)
_SINCE_WHEN = ("convergence_time_s", "facing_since_s")
_OF_ROTATION = ("rmse_rotating_deg_s", "angle_error_deg", "overshoot_deg")


class Row(NamedTuple):
    """One line of a table; `text` is a dash for what is not defined."""

    label: str
    text: str
    unit: str


def rows(values: dict[str, Any]) -> list[Row]:
    """The metrics in the order of a table; those of a rotation only for a reference that asks for one."""
    found = [(name, label, _value(values, name), unit, form) for name, label, unit, form in _ROWS]
    since = f"{round(max(SETTLING_S, values['begins_at_s']), 3):g} s"
    return [
        Row(label.replace("SINCE", since) + at_the_latest(values, name), _text(value, form), unit)
        for name, label, value, unit, form in found
        if value is not None or name not in _OF_ROTATION
    ] + [_change(change) for change in values["parameter_changes"]]


def missing(values: dict[str, Any]) -> str:
    """A sentence on the steps that a recording lacks at its beginning; empty where it lacks none."""
    if not values["missing_steps"]:
        return ""
    steps = f"steps 0 to {values['missing_steps'] - 1} are" if values["missing_steps"] > 1 else "step 0 is"
    begins = f"{steps} not in the recording, it begins at {values['begins_at_s']:.3f} s"
    return f"{begins}: every figure is of what is there"


def reference_added(steps: int) -> str:
    """A sentence on the steps of the reference that a recording does not tell; empty where it tells all."""
    those = "1 step of the reference is" if steps == 1 else f"{steps} steps of the reference are"
    return f"{those} not in the recording: the recorded scenario stands in" if steps else ""


def at_the_latest(values: dict[str, Any], name: str) -> str:
    """Words behind the label of a time that may lie before what was recorded."""
    in_doubt = name in _SINCE_WHEN and values["missing_steps"] and values[name] == values["begins_at_s"]
    return " (at the latest)" if in_doubt else ""


def _change(change: dict[str, Any]) -> Row:
    """A change in flight; a node without any parameter changed has only begun anew."""
    values = ", ".join(f"{name} = {value}" for name, value in change["parameters"].items())
    return Row(f"{change['node']} from {change['time_s']:.3f} s on", values or "begun anew", "")


def _value(values: dict[str, Any], name: str) -> float | str | None:
    first, _, rest = name.partition(".")
    value: float | str | None = values[first][rest] if rest else values[first]
    return value


def _text(value: float | str | None, form: str) -> str:
    return "-" if value is None else format(value, form)
