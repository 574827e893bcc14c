# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc recover``: a complete bag from a recording that was cut short or damaged."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError

if TYPE_CHECKING:
    from skydiver_utc.recording.recovery import Loss, Survey


@click.command(short_help="Complete a recording that was cut short or damaged.")
@options.run_folder
@click.option("--out", type=options.PATH, metavar="FOLDER", help="The new folder, instead of RUN_recovered.")
@options.as_json
def recover(folder: Path, out: Path | None, as_json: bool) -> None:
    """Write the readable messages of the recording RUN into a new run folder; RUN is not changed.

    For a recorder that was killed, which loses at most about the last half second, and for damaged files. Of a
    complete recording nothing is written.
    """
    from skydiver_utc.parameters.run_folder import SCENARIO_FILE, VERSIONS_FILE, text_of
    from skydiver_utc.recording import recovery

    if out is not None and out.exists():
        raise CommandError(f"{out} exists already: name another folder, or move this one away")
    found = recovery.survey(folder)
    into = None
    if not found.whole:
        into = out or folder.with_name(f"{folder.stem if folder.is_file() else folder.name}_recovered")
        source = folder if folder.is_dir() else folder.parent
        texts = {name: text_of(source / name) for name in (SCENARIO_FILE, VERSIONS_FILE)}
        recovery.recover(folder, into, {name: text for name, text in texts.items() if text})
    if as_json:
        print(json.dumps(_as_dict(found, into), indent=2))
        return
    for line in _lines(found, into):
        click.echo(line)


def _lines(found: "Survey", folder: Path | None) -> list[str]:
    from skydiver_utc.parameters.nanoseconds import seconds

    if folder is None:
        return [f"{found.path} is complete ({found.message_count} messages), there is nothing to recover"]
    first, last = found.log_span_ns or (0, 0)
    length_s = seconds(last - first)
    lines = [f"recovered {found.message_count} messages, {length_s:.3f} s of simulated time, into {folder}"]
    lines += [_loss_line(loss, first) for loss in found.losses]
    if found.lost_messages is None:
        lines.append(
            f"the recording has no end: messages after {length_s:.3f} s were not written, about the last half"
            " second before the recorder was killed"
        )
    elif found.lost_messages:
        lines.append(f"lost {found.lost_messages} of {found.message_count + found.lost_messages} messages")
    elif not found.losses:
        lines.append("no message is lost, only the metadata or an index was missing or wrong")
    return [*lines, f"{found.path} is unchanged"]


def _loss_line(loss: "Loss", first_ns: int) -> str:
    from skydiver_utc.parameters.nanoseconds import seconds

    after = "from the start" if loss.after_ns is None else f"after {seconds(loss.after_ns - first_ns):.3f} s"
    before = "to the end" if loss.before_ns is None else f"before {seconds(loss.before_ns - first_ns):.3f} s"
    return f"left out {loss.byte_count} unreadable bytes of {loss.file}, {after} {before}"


def _as_dict(found: "Survey", folder: Path | None) -> dict[str, Any]:
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
