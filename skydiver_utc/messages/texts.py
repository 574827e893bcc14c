# SPDX-License-Identifier: Apache-2.0
"""The texts on `scenario`, `changes` and `outcome`: written by the nodes, read by recorder and analysis."""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from skydiver_utc.messages.errors import MessageError

_RUN_ID = re.compile(r"^# run_id: (\S+)$", re.MULTILINE)


def scenario_text(yaml: str, run_id: str) -> str:
    """The resolved scenario as YAML; the id of its run stands in a comment on the first line."""
    return f"# run_id: {run_id}\n{yaml}"


def run_id_of(text: str) -> str:
    """The run's id in a scenario's text, empty without one."""
    found = _RUN_ID.search(text)
    return found[1] if found else ""


def change_text(node: str, k: int, parameters: Mapping[str, object], control: Sequence[float] | None) -> str:
    """JSON: from step k on the node works with these values; a controller began there from `control`."""
    return json.dumps({"node": node, "step": k, "parameters": dict(parameters), "control": control})


def outcome_text(run_id: str, outcome: str, reason: str, **values: object) -> str:
    """JSON: how the run with this id ended."""
    return json.dumps({"run_id": run_id, "outcome": outcome, "reason": reason, **values})


def read_outcome(text: str) -> dict[str, Any]:
    """The values of an `outcome_text`, with `wall_time_s` and `states`; `run_id` is empty where it has none."""
    try:
        found = dict(json.loads(text))
        outcome, reason, states = str(found["outcome"]), str(found["reason"]), int(found["states"])
        wall_time_s, run_id = float(found["wall_time_s"]), str(found.get("run_id", ""))
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        raise MessageError("outcome", f"it does not say how the run ended ({error!r})") from error
    if states < 0:
        raise MessageError("outcome", f"it says that the run had {states} states")
    return found | {
        "outcome": outcome, "reason": reason, "states": states, "wall_time_s": wall_time_s, "run_id": run_id
    }  # fmt: skip
