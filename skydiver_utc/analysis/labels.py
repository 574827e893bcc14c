# SPDX-License-Identifier: Apache-2.0
"""Metrics as people read them: label, number and unit."""

from typing import Any, NamedTuple

from skydiver_utc.analysis.numbers import SETTLING_S
from skydiver_utc.analysis.style import short
from skydiver_utc.analysis.units import in_degrees

# Of each tracked output. In a label SINCE is the time from which on the errors count.
_OF_OUTPUT = (
    ("rmse", "RMSE from SINCE on", ".3g"),
    ("max_abs_error", "largest error from SINCE on", ".3g"),
    ("convergence_time_s", "inside 5 % for good from", ".2f"),
    ("peak", "peak from SINCE on", ".4g"),
)
_ROWS = (
    ("rmse_rotating_deg_s", "RMSE while it is to turn", "deg/s", ".2f"),
    ("angle_error_deg", "angle turned less wanted", "deg", ".1f"),
    ("overshoot_deg", "overshoot", "deg", ".1f"),
    ("facing", "at the end", "", ""),
    ("facing_since_s", "so since", "s", ".2f"),
    ("min_dorsal_axis", "lowest dorsal axis", "", ".3f"),
    ("control_effort", "control effort", "", ".4f"),
    ("solve_time_us.median", "controller call, median", "us", ".1f"),
    ("solve_time_us.p99", "controller call, 99th percentile", "us", ".1f"),
    ("simulated_time_s", "simulated time", "s", ".2f"),
    ("wall_time_s", "wall time", "s", ".2f"),
)
_MOST_HOLES = 3  # that are listed
_LATE = 0.9  # of the simulated time
_SINCE_WHEN = ("convergence_time_s", "facing_since_s")
_OF_ROTATION = ("rmse_rotating_deg_s", "angle_error_deg", "overshoot_deg")


class Row(NamedTuple):
    """One line of a table; `text` is a dash for what is not defined."""

    label: str
    text: str
    unit: str


def rows(values: dict[str, Any]) -> list[Row]:
    """The metrics in the order of a table; those of a rotation only for a reference that asks for one."""
    since = f"{round(max(SETTLING_S, values['begins_at_s']), 3):g} s"
    found = []
    for name, output in values["outputs"].items():
        unit, factor = in_degrees(output["unit"])
        for key, label, form in _OF_OUTPUT:
            value, in_s = output[key], key == "convergence_time_s"
            scaled = value if value is None or in_s else factor * value
            words = f"{name.replace('_', ' ')}: {label.replace('SINCE', since)}{_remark(values, key, value)}"
            found.append(Row(words, _text(scaled, form), "s" if in_s else unit))
    for name, label, unit, form in _ROWS:
        value = _value(values, name)
        if name.partition(".")[0] in values and (value is not None or name not in _OF_ROTATION):
            found.append(Row(label + _remark(values, name, value), _text(value, form), unit))
    for name, sensor in values.get("estimation", {}).get("sensors", {}).items():
        low, high = (_text(bound, ".3g") for bound in sensor["nis_bounds"])
        label = f"{name.replace('_', ' ')}: mean NIS, {low} to {high} expected: {sensor['verdict']}"
        found.append(Row(label, _text(sensor["nis_mean"], ".3g"), ""))
    return found + [_change(change) for change in values["parameter_changes"]]


def label_of(metric: str) -> str:
    """A metric's label and unit as at an axis; its name where it has none."""
    known = {name: f"{label} [{unit or 1}]" for name, label, unit, _ in _ROWS}
    of_output = {name: label for name, label, _ in _OF_OUTPUT}
    known |= {f"{name}_deg_s": f"{label} [deg/s]" for name, label in of_output.items()}
    known["convergence_time_s"] = f"{of_output['convergence_time_s']} [s]"
    return known.get(metric, metric).replace("SINCE", f"{SETTLING_S:g} s")


def facts(values: dict[str, Any]) -> list[str]:
    """The outcome, and how closely and since when the outputs were tracked, in a few words each."""
    found, outputs = [values["outcome"].replace("_", " ")], values["outputs"]
    for name, output in outputs.items():
        unit, factor = in_degrees(output["unit"])
        of = f"{name.replace('_', ' ')}: " if len(outputs) > 1 else ""
        for key, words in (("rmse", f"{of}RMSE"), ("max_abs_error", "largest error")):
            if output[key] is not None:
                found.append(f"{words} {short(factor * output[key])} {unit}")
    since = values["convergence_time_s"]
    if since is not None:
        found.append(f"inside 5 % from {since:.2f} s on{_remark(values, 'convergence_time_s', since)}")
    return found


def missing(values: dict[str, Any]) -> str:
    """A sentence on the steps that a recording lacks at its beginning or within; empty where it lacks none."""
    steps, holes = values["missing_steps"], values["holes_s"]
    lacks = [f"0 to {steps - 1}, before {values['begins_at_s']:.3f} s"] if steps else []
    lacks += [f"from {begin:.3f} to {end:.3f} s" for begin, end in holes[:_MOST_HOLES]]
    lacks += [f"in {len(holes) - _MOST_HOLES} other stretches"] if len(holes) > _MOST_HOLES else []
    return f"the recording lacks steps {', '.join(lacks)}: the figures are of the rest" if lacks else ""


def reference_added(steps: int) -> str:
    """A sentence on the steps of the reference that are not in a recording; empty where all are."""
    those = "1 step of the reference is" if steps == 1 else f"{steps} steps of the reference are"
    return f"{those} not in the recording: the recorded scenario's own values are used" if steps else ""


def _remark(values: dict[str, Any], name: str, value: Any) -> str:
    """Words behind the label of a time that may lie within what was not recorded, or that may be chance."""
    after = {end for _, end in values["holes_s"]} | (
        {values["begins_at_s"]} if values["missing_steps"] else set()
    )
    if name in _SINCE_WHEN and value in after:
        return " (at the latest)"
    late = name == "convergence_time_s" and value is not None and value > _LATE * values["simulated_time_s"]
    return " (near the end: it may be chance)" if late else ""


def _change(change: dict[str, Any]) -> Row:
    """A change during the run; one without parameters is a restart of the node."""
    values = ", ".join(f"{name} = {value}" for name, value in change["parameters"].items())
    return Row(f"{change['node']} from {change['time_s']:.3f} s on", values or "restarted", "")


def _value(values: dict[str, Any], name: str) -> float | str | None:
    first, _, rest = name.partition(".")
    return values.get(first, {}).get(rest) if rest else values.get(first)


def _text(value: float | str | None, form: str) -> str:
    return "-" if value is None else format(value, form)
