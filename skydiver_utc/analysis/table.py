# SPDX-License-Identifier: Apache-2.0
"""A run as one table, for other programs."""

import io
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import to_yaml

FORMS = ("csv", "npz", "parquet")


def columns(run: Run) -> dict[str, Array]:
    """The columns (K+1,) by name, SI and radians; NaN where there is no value, as of a control at the last state."""
    plant = run.plant
    blocks = {
        "state": (plant.state_names, run.states),
        "output": (plant.output_names, run.outputs),
        "reference": (run.tracked_names, run.reference),
        "command": (plant.control_names, run.commands),
        "applied_command": (plant.control_names, run.applied),
        "telemetry": (run.telemetry_names, run.telemetry),
        "disturbance": (run.disturbance_names, run.disturbance),
    }
    found = {"time_s": run.time_s}
    for topic, (names, values) in blocks.items():
        found |= {f"{topic}/{name}": _whole(run, values[:, j]) for j, name in enumerate(names)}
    return found | {"solve_time_s": _whole(run, run.solve_time_s), "status": _whole(run, run.status)}


def table(run: Run, form: str) -> bytes:
    """The columns as csv, npz or parquet; the last two hold the scenario as YAML, too, under `scenario`.

    Raises ModuleNotFoundError for parquet without pyarrow.
    """
    found, scenario, buffer = columns(run), to_yaml(run.scenario), io.BytesIO()
    if form == "csv":
        values = np.column_stack(list(found.values()))
        np.savetxt(buffer, values, "%.17g", ",", header=",".join(found), comments="")
    elif form == "npz":
        arrays: dict[str, Any] = {**found, "scenario": np.array(scenario)}
        np.savez_compressed(buffer, **arrays)
    else:
        import pyarrow
        from pyarrow import parquet

        made = pyarrow.table(found).replace_schema_metadata({"scenario": scenario})
        parquet.write_table(made, buffer)
    return buffer.getvalue()


def _whole(run: Run, values: Array) -> Array:
    """Values of the steps with one for the last state, too."""
    return np.append(values, np.full(len(run.states) - len(values), np.nan))
