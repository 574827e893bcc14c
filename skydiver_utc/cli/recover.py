# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc recover``: a complete bag from a recording that was cut short or damaged."""

import json
from pathlib import Path
from typing import Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.screen import show_lines, show_values


@click.command(short_help="Complete a recording that was cut short or damaged.")
@options.run_folder
@click.option("--out", type=options.PATH, metavar="FOLDER", help="The new folder, instead of RUN_recovered.")
@options.as_json
def recover(folder: Path, out: Path | None, as_json: bool) -> None:
    """Write the readable messages of the recording RUN into a new run folder; RUN is not changed.

    For a recorder that was killed, which loses at most about the last half second, and for damaged files. Of a
    complete recording nothing is written.
    """
    from skydiver_utc.parameters.nanoseconds import seconds
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
    first, last = found.log_span_ns or (None, None)
    values: dict[str, Any] = {
        "whole": found.whole,
        "recovered_into": None if into is None else str(into),
        "messages": found.message_count,
        "messages_by_topic": dict(sorted(found.counts.items())),
        "first_ns": first,
        "last_ns": last,
        "lost_messages": found.lost_messages,
        "losses": [loss._asdict() for loss in found.losses],
    }
    if as_json:
        print(json.dumps(values, indent=2))
        return
    if into is None:
        show_lines(f"{found.path} is complete ({found.message_count} messages), there is nothing to recover")
        return

    def since_first(ns: int | None) -> float | None:
        return None if ns is None or first is None else seconds(ns - first)

    values["messages_until_s"] = since_first(last)
    values["losses"] = [
        {
            "file": loss.file,
            "unreadable bytes": loss.byte_count,
            "after_s": since_first(loss.after_ns),
            "before_s": since_first(loss.before_ns),
        }
        for loss in found.losses
    ]
    show_values(values, False, "whole", "first_ns", "last_ns")
    if found.lost_messages is None:
        show_lines(
            "the recording has no end: about the last half second before the recorder was killed is lost"
        )
