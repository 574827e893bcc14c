# SPDX-License-Identifier: Apache-2.0
"""From plain data to a checked `Scenario`; the error names every wrong field, each in one clause."""

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple, TypeVar, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from skydiver_utc.errors import OwnClassError, ParameterError
from skydiver_utc.parameters.registry import settings_class
from skydiver_utc.parameters.scenario import SLOTS, Scenario, laid_over

_DEFAULTS: Mapping[str, Any] = {"estimator": {"kind": "true_state"}, "disturbances": []}
_MOST_SHOWN = 10
# What a field must be, by pydantic's type of error and with the values of its context.
_EXPECTED = {
    "greater_than_equal": "at least {ge:g}",
    "less_than_equal": "at most {le:g}",
    "int_type": "a whole number",
    "model_type": "a block of named values",
    "dict_type": "a block of named values",
    "tuple_type": "a list",
    "string_type": "a text",
    "float_type": "a number",
    "bool_type": "true or false",
}
_Settings = TypeVar("_Settings", bound=BaseModel)


class Unresolved(NamedTuple):
    """Stands in plain data for the content of a file that cannot be read; `error` says why."""

    error: str


def convert(content: Mapping[str, Any], origin: str, found: Iterable[str] = ()) -> Scenario:
    """The scenario of plain data without file names; `ParameterError` names, after `found`, every wrong field."""
    blocks = {**_DEFAULTS, **content}
    errors = list(found)
    for name in SLOTS:
        if name in blocks:
            blocks[name] = slot_settings(name, name, blocks[name], errors)
    if blocks.get("plant") is not None and isinstance(truth := blocks.get("truth"), Mapping):
        slot_settings("plant", "truth", laid_over(content["plant"], truth), errors)
    if isinstance(blocks["disturbances"], list | tuple):
        found = [
            slot_settings("disturbance", f"disturbances[{i}]", block, errors)
            for i, block in enumerate(blocks["disturbances"])
        ]
        blocks["disturbances"] = tuple(block for block in found if block is not None)
    # A slot whose block is wrong has its errors already.
    wrong = {name for name in SLOTS if name in blocks and blocks[name] is None}
    try:
        scenario = Scenario.model_validate({n: block for n, block in blocks.items() if n not in wrong})
    except ValidationError as error:
        known = list(_field_names(Scenario))
        known += [
            f"{name}.{field}" for name in SLOTS for field in _field_names(_model(name, content.get(name)))
        ]
        errors += _clauses((e for e in error.errors() if wrong.isdisjoint(e["loc"])), "", blocks, known)
    if errors:
        more = len(errors) - _MOST_SHOWN
        shown = [*errors[:_MOST_SHOWN], *([f"and {more} more"] if more > 0 else [])]
        raise ParameterError(f"{'; '.join(shown)} (scenario {origin})")
    return scenario


def _model(slot: str, block: Any) -> type[BaseModel] | None:
    """The class of the settings in a slot's block, None where its kind is wrong."""
    try:
        return settings_class(slot, block["kind"])
    except (ParameterError, LookupError, TypeError, AttributeError):
        return None


def checked(model: type[_Settings], content: Mapping[str, Any]) -> _Settings:
    """Settings of a class from plain data; raises `ParameterError` that names every wrong field."""
    errors: list[str] = []
    if (found := _validated(model, content, "", errors)) is None:
        raise ParameterError("; ".join(errors[:_MOST_SHOWN]))
    return found


def slot_settings(slot: str, name: str, block: Any, errors: list[str]) -> Any:
    """The settings of a block of a slot; None where it is wrong, with the reasons added to `errors`."""
    if not isinstance(block, Mapping):
        errors.append(f"parameter {name} must be a block of named values, found {block!r}")
        return None
    kind = block.get("kind")
    if not isinstance(kind, str):
        errors.append(f"parameter {name}.kind is missing: write it")
        return None
    try:
        model = settings_class(slot, kind)
    except OwnClassError as error:
        raise OwnClassError(f"parameter {name}.kind: {error}") from error
    except ParameterError as error:
        errors.append(f"parameter {name}.kind: {error}")
        return None
    return _validated(model, block, f"{name}.", errors)


def _validated(
    model: type[_Settings], block: Mapping[str, Any], prefix: str, errors: list[str]
) -> _Settings | None:
    """The settings of a block whose dotted names begin with the prefix; None where `errors` got a clause."""
    try:
        return model.model_validate(block)
    except ValidationError as error:
        errors += _clauses(error.errors(), prefix, block, list(_field_names(model)))
        return None


def _clauses(errors: Iterable[ErrorDetails], prefix: str, block: Any, known: list[str]) -> list[str]:
    """One clause for each wrong field; of a field that may be one of several types, what the first type must be."""
    first: dict[str, ErrorDetails] = {}
    for error in errors:
        first.setdefault(".".join(_place(error, block)), error)
    # A text from anywhere may have very many: only those are put into words that can be shown.
    return [
        _clause(error, place, prefix, known) if i < _MOST_SHOWN else ""
        for i, (place, error) in enumerate(first.items())
    ]


def _clause(error: ErrorDetails, place: str, prefix: str, known: list[str]) -> str:
    """One wrong field: its dotted name, what is wrong and what to do."""
    name = prefix + place
    context = error.get("ctx", {})
    if isinstance(error["input"], Unresolved):
        return error["input"].error
    match error["type"]:
        case "extra_forbidden":
            last = place.rpartition(".")[2]
            close = difflib.get_close_matches(place, known) or [n for n in known if n.endswith(f".{last}")]
            return f"unknown parameter {name}: " + (
                f"did you mean {prefix}{close[0]}" if close else "take it out"
            )
        case "missing":
            return f"parameter {name} is missing: write it"
        case "union_tag_not_found":
            return f"parameter {name}.kind is missing: write it"
        case "union_tag_invalid":
            choices = context["expected_tags"].replace("'", "")
            return f"parameter {name}.kind: there is no {context['tag']!r}, choose one of {choices}"
        case "literal_error":
            choices = ", ".join(re.findall("'([^']*)'", context["expected"]))
            return f"parameter {name}: there is no {error['input']!r}, choose one of {choices}"
        case "too_short" | "too_long":
            size = context.get("min_length", context.get("max_length"))
            return f"parameter {name} must have {size} entries, it has {context['actual_length']}"
        case "value_error":
            return f"{name.rstrip('.')}: {context['error']}" if name else str(context["error"])
        case kind:
            plain = error["msg"].removeprefix("Input should be ")
            expected = _EXPECTED[kind].format(**context) if kind in _EXPECTED else plain
            found = error["input"]
            shown = f", found {found!r}" if found is None or isinstance(found, str | int | float) else ""
            return f"parameter {name} must be {expected}{shown}"


def _place(error: ErrorDetails, block: Any) -> Iterator[str]:
    """Names down to the wrong field; pydantic's names for the members of a union, not in the data, are left out."""
    for i, part in enumerate(error["loc"]):
        if isinstance(block, Mapping):
            last_is_missing = error["type"] == "missing" and i == len(error["loc"]) - 1
            if part not in block and not last_is_missing:
                continue
            block = block.get(part)
        elif isinstance(block, list | tuple) and isinstance(part, int):
            block = block[part] if part < len(block) else None
        else:
            continue
        yield str(part)


def _field_names(model: Any, prefix: str = "") -> Iterator[str]:
    """Dotted names of all fields of a model and of the blocks in it."""
    # On Python 3.10 tuple[float, float] is an instance of type, too.
    if get_origin(model) is None and isinstance(model, type) and issubclass(model, BaseModel):
        for name, field in model.model_fields.items():
            yield prefix + name
            yield from _field_names(field.annotation, f"{prefix}{name}.")
