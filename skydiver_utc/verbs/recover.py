"""``skydiver-utc recover``: a whole bag out of a recording that was cut short or damaged."""

import json
import shutil
from pathlib import Path
from typing import Any

import click

from skydiver_utc.recording.recovery import Loss, Survey, survey
from skydiver_utc.recording.recovery import recover as save
from skydiver_utc.verbs.errors import VerbError

# What the recorder writes beside the bag when it begins.
_BESIDE = ("scenario.yaml", "versions.json")


def recover(path: Path, out: Path | None, as_json: bool) -> None:
    """Tell what is whole; write the rest of it into `out`, a folder that does not exist yet."""
    if out is not None and out.exists():
        raise VerbError(f"{out} exists already: name another folder, or move this one away")
    found = survey(path)
    folder = (
        None
        if found.whole
        else out or path.with_name(f"{path.stem if path.is_file() else path.name}_recovered")
    )
    if folder is not None:
        save(path, folder)
        for name in _BESIDE:
            source = (path if path.is_dir() else path.parent) / name
            if source.is_file():
                shutil.copy2(source, folder / name)
    if as_json:
        print(json.dumps(_report(found, folder), indent=2))
    else:
        for line in sentences(found, folder):
            click.echo(line)


def sentences(found: Survey, folder: Path | None) -> list[str]:
    """What was found, for the screen."""
    if folder is None:
        return [f"{found.path} is whole ({found.message_count} messages), there is nothing to recover"]
    first, last = found.log_span_ns or (0, 0)
    lines = [
        f"recovered {found.message_count} messages, {(last - first) / 1e9:.3f} s of simulated time, into {folder}"
    ]
    lines += [_lost(loss, first) for loss in found.losses]
    if found.lost_messages is None:
        lines.append(
            f"the recording has no end: what came after {(last - first) / 1e9:.3f} s was not written yet and is"
            " lost, about the last half second before the recorder was killed"
        )
    elif found.lost_messages:
        lines.append(f"lost {found.lost_messages} of {found.message_count + found.lost_messages} messages")
    elif not found.losses:
        lines.append("no message is lost, only the metadata or an index was missing or wrong")
    return [*lines, f"{found.path} is as it was"]


def _lost(loss: Loss, first_ns: int) -> str:
    after = "from the start" if loss.after_ns is None else f"after {(loss.after_ns - first_ns) / 1e9:.3f} s"
    before = "to the end" if loss.before_ns is None else f"before {(loss.before_ns - first_ns) / 1e9:.3f} s"
    return f"left out {loss.byte_count} unreadable bytes of {loss.file}: what lay {after} and {before}"


def _report(found: Survey, folder: Path | None) -> dict[str, Any]:
    return {
        "whole": found.whole,
        "recovered_into": None if folder is None else str(folder),
        "messages": found.message_count,
        "messages_by_topic": dict(sorted(found.counts.items())),
        "first_ns": None if found.log_span_ns is None else found.log_span_ns[0],
        "last_ns": None if found.log_span_ns is None else found.log_span_ns[1],
        "lost_messages": found.lost_messages,
        "losses": [loss._asdict() for loss in found.losses],
    }
