# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc``: the commands by name; each stands in a file of its own, which is imported when it is used."""

import gc
import sys
from importlib import import_module
from io import TextIOWrapper
from typing import Any

import click

from skydiver_utc import __version__
from skydiver_utc.cli.errors import exit_code_of

# Imports make many objects that stay: garbage collection takes 7 % of a warm start at Python's own threshold.
_GARBAGE_THRESHOLD = 100_000
_COMMANDS = (
    "analyse", "calibrate", "compare", "export", "inputs", "pattern", "recover", "replay", "report", "run",
    "scenarios", "simulate", "stability", "study", "trim", "urdf", "view",
)  # fmt: skip


class Commands(click.Group):
    """Imports ``skydiver_utc.cli.NAME`` for the command NAME; turns errors into a sentence and an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        return getattr(import_module(f"skydiver_utc.cli.{cmd_name}"), cmd_name)

    def invoke(self, ctx: click.Context) -> Any:
        gc.set_threshold(_GARBAGE_THRESHOLD)
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):  # characters that the user's locale has not
                stream.reconfigure(errors="replace")
        try:
            code = super().invoke(ctx) or 0
            sys.stdout.flush()
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except (KeyboardInterrupt, Exception) as error:
            code = exit_code_of(error)
            if code is None:
                raise
        ctx.exit(code)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, message="%(version)s")
def main() -> None:
    """A virtual skydiver flown by the Unscented Transform Controller, or a plant and a controller of your own.

    SCENARIO is a name that `skydiver-utc scenarios` lists, or the path of a YAML file.
    """


if __name__ == "__main__":
    main()
