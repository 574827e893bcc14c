# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc inputs``: the controls of a recorded run, estimated from its states."""

from pathlib import Path

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.screen import show_values


@click.command(cls=options.Computing, short_help="Estimate the inputs of the run folder RUN.")
@options.run_folder
@options.as_json
def inputs(folder: Path, as_json: bool) -> None:
    """Estimate the controls of the recorded run RUN from its states, beside what was applied.

    The filter that UTC came from: sigma points of the controls drive the model over 0.25 s to the measured outputs.
    Writes inputs.json and inputs.png into RUN. The states are the recorded estimates of a run on sensors, else the
    true ones. Controls that hardly move the outputs are reported as not seen.
    """
    from skydiver_utc.analysis.control_figures import inputs_figure
    from skydiver_utc.analysis.inputs import estimate_inputs, report
    from skydiver_utc.analysis.metrics import to_json
    from skydiver_utc.analysis.recorded_run import read_run
    from skydiver_utc.analysis.style import png
    from skydiver_utc.parameters.files import write_file

    if folder.is_file():
        raise CommandError(f"{folder} is a file: give the run folder that it lies in")
    found = estimate_inputs(read_run(folder))
    values = report(found)
    write_file(folder / "inputs.json", to_json(values) + "\n")
    write_file(folder / "inputs.png", png(inputs_figure(found)))
    show_values(values, as_json, "schema_version", "time_s", "estimate", "deviation", "applied")
