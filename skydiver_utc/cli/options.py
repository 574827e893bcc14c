# SPDX-License-Identifier: Apache-2.0
"""Options that several commands have."""

from functools import partial
from pathlib import Path
from typing import Any

import click

EXIT_CODES = """\b
exit code
    0  the run reached its end (outcome completed or rolled_over)
    1  it ended before: diverged, no_command, aborted, or a node failed
    2  the input is wrong: one sentence says why, nothing was started
  130  stopped with Ctrl-C
"""
PATH = click.Path(path_type=Path)


def report_compilation() -> None:
    """Let the first compilation of a kernel be reported on stderr."""
    from skydiver_utc.jit import on_first_compilation

    on_first_compilation(partial(click.echo, err=True))


class Computing(click.Command):
    """A command that may compile kernels."""

    def invoke(self, ctx: click.Context) -> Any:
        if not ctx.params.get("quiet"):
            report_compilation()
        return super().invoke(ctx)


def number(text: object) -> float:
    """The type of a number: written as in YAML."""
    from skydiver_utc.parameters import yaml_io

    return yaml_io.number(str(text))


scenario = click.argument("scenario", metavar="SCENARIO")
run_folder = click.argument("folder", metavar="RUN", type=PATH)
settings = click.option(
    "--set", "settings", multiple=True, metavar="NAME=VALUE",
    help="Override one setting by its dotted name, for example controller.horizon_steps=5. Repeatable.",
)  # fmt: skip
as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of a table.")
within = click.option(
    "--scenario", default="bank_recovery", show_default=True, metavar="SCENARIO",
    help="The scenario with all settings that are not given: air, limits, subject.",
)  # fmt: skip
quiet = click.option("--quiet", is_flag=True, help="No progress bar, nothing on stderr but errors.")
force = click.option("--force", is_flag=True, help="Overwrite existing files.")
out_file = click.option("--out", type=PATH, metavar="FILE.yaml", help="Write here instead of on the screen.")
out_folder = click.option(
    "--out", type=PATH, metavar="FOLDER", help="Write files into this folder; made if missing."
)
seed = click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(0), help="Seed of every random draw."
)
workers = click.option(
    "--workers", default=2, show_default=True, type=click.IntRange(1, 256),
    help="Processes that simulate at the same time.",
)  # fmt: skip
