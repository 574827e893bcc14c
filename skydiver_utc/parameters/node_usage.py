# SPDX-License-Identifier: Apache-2.0
"""The help text of a node, from its settings alone."""

from typing import Any

from skydiver_utc.parameters.nodes import SETTINGS

_OF_SCENARIO = (
    "",
    "Every scalar of the scenario can be given, too, by its dotted name, such as controller.horizon_steps.",
)


def usage(kind: str) -> str:
    """The text of `<kind>_node --help`."""
    model = SETTINGS[kind]
    fields = model.model_fields
    width = max(map(len, fields))
    rows = [f"  {name:{width}}  {_default(field)}  {field.description}" for name, field in fields.items()]
    return "\n".join(
        [
            f"usage: {kind}_node [--ros-args -p NAME:=VALUE ... --params-file FILE ...]",
            "",
            (model.__doc__ or "").strip(),
            "",
            "parameters:",
            *rows,
            *(_OF_SCENARIO if "scenario" in fields else ()),
        ]
    )


def _default(field: Any) -> str:
    if field.is_required():
        return "(needed)"
    value = list(field.default) if isinstance(field.default, tuple) else field.default
    unit = (field.json_schema_extra or {}).get("unit", "1")
    return f"{value if value != '' else '(empty)'}" + (f" {unit}" if unit != "1" else "")
