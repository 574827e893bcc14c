# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc``: options and help of every command; what a command needs is imported when it runs."""

import errno
import os
import sys
from contextlib import suppress
from functools import partial
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn

import click

from skydiver_utc import __version__
from skydiver_utc.plants.skydiver.pattern_kinds import DEFAULT_KIND, PATTERN_KINDS

_EXIT_CODES = """\b
exit code
    0  the run reached its end (outcome completed or rolled_over)
    1  it ended before: diverged, no_command, aborted, or a node failed
    2  the input is wrong: one sentence says why, nothing was started
  130  stopped with Ctrl-C
"""
_CHECK_EXIT_CODES = """\b
exit code of --check
    0  every command is the recorded one
    1  some are not
    2  the input is wrong: one sentence says why
"""
_CALIBRATE_EXIT_CODES = """\b
exit code
    0  every target is met
    1  some are not: the best skydiver was written
    2  the input is wrong: one sentence says why
  130  stopped with Ctrl-C: the same command continues
"""
_STUDY_EXIT_CODES = """\b
exit code
    0  every run ended, whatever its outcome
    1  some runs failed, or a worker or the scheduler ended: the same command continues
    2  the input is wrong: one sentence says why, nothing was started
  130  stopped with Ctrl-C: the same command continues
"""
_UNSET = (None, False, ())
_PATH = click.Path(path_type=Path)


class Commands(click.Group):
    """Turns the errors of wrong input into one sentence; any other error is a fault of the program."""

    def invoke(self, ctx: click.Context) -> Any:
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):  # characters that the user's locale has not
                stream.reconfigure(errors="replace")
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except KeyboardInterrupt:
            from skydiver_utc.parameters.exit_codes import STOPPED

            click.echo("stopped", err=True)
            ctx.exit(STOPPED)
        except _input_errors() as error:
            from skydiver_utc.cli.errors import printable
            from skydiver_utc.parameters.exit_codes import FAILED, REFUSED

            code = getattr(error, "exit_code", REFUSED)
            if isinstance(error, OSError):
                full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EIO)
                if error.filename is None and not full:
                    raise
                if error.filename is None:
                    _drop_output()
                code = FAILED if full else REFUSED
            click.echo(f"Error: {printable(_sentence(error))}", err=True)
            ctx.exit(code)


def _input_errors() -> tuple[type[Exception], ...]:
    """Imported only after an error."""
    from skydiver_utc.analysis.errors import AnalysisError
    from skydiver_utc.cli.errors import CommandError
    from skydiver_utc.parameters.errors import ParameterError
    from skydiver_utc.recording.errors import RecordingError

    return (ParameterError, RecordingError, AnalysisError, CommandError, OSError)


def _drop_output() -> None:
    """Let nothing more be written to a stdout that cannot be written."""
    with suppress(OSError):  # a stdout without a file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is None:
        return f"the output cannot be written ({error.strerror}): make room, or write it elsewhere"
    if isinstance(error, OSError):
        return f"{error.filename} cannot be used ({error.strerror}): choose another path, or repair this one"
    return str(error)


def _run(module: str, function: str, **options: Any) -> NoReturn:
    """Call a function of a command's module; it returns the exit code, or nothing for 0."""
    command = getattr(import_module(f"skydiver_utc.cli.{module}"), function)
    if "numba" in sys.modules and not options.get("quiet"):  # without numba the command compiles nothing
        from skydiver_utc.jit import on_first_compilation

        on_first_compilation(partial(click.echo, err=True))
    code = command(**options) or 0
    sys.stdout.flush()
    raise SystemExit(code)


def _number(text: object) -> float:
    """The type of a number: written as in YAML."""
    from skydiver_utc.parameters.yaml_io import number

    return number(str(text))


class _Written(click.ParamType):  # type: ignore[type-arg]
    """Takes numbers that are written as in YAML."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            _number(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)
        return super().convert(value, param, ctx)


class _Count(_Written, click.IntRange):
    """The type of a whole number."""


class _Factor(_Written, click.FloatRange):
    """The type of a factor."""


_version = click.version_option(__version__, message="%(version)s")
_scenario = click.argument("scenario", metavar="SCENARIO")
_run_folder = click.argument("folder", metavar="RUN", type=_PATH)
_settings = click.option(
    "--set", "settings", multiple=True, metavar="NAME=VALUE",
    help="Override one setting by its dotted name, for example controller.horizon_steps=5. Repeatable.",
)  # fmt: skip
_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of a table.")
_within = click.option(
    "--scenario", default="bank_recovery", show_default=True, metavar="SCENARIO",
    help="The scenario with all settings that are not given: air, limits, subject.",
)  # fmt: skip
_quiet = click.option("--quiet", is_flag=True, help="No progress bar, nothing on stderr but errors.")
_force = click.option("--force", is_flag=True, help="Overwrite existing files.")
_out_file = click.option(
    "--out", type=_PATH, metavar="FILE.yaml", help="Write here instead of on the screen."
)
_out_folder = click.option(
    "--out", type=_PATH, metavar="FOLDER", help="Write files into this folder; made if missing."
)
_jobs = click.option(
    "--jobs",
    default=2,
    show_default=True,
    type=_Count(1),
    help="Processes that simulate at the same time.",
)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@_version
def main() -> None:
    """A virtual skydiver flown by the Unscented Transform Controller, or a plant and a controller of your own.

    SCENARIO is a name that `skydiver-utc scenarios` lists, or the path of a YAML file.
    """


@main.command(short_help="List the scenarios, or show one.")
@click.option("--show", metavar="SCENARIO", help="Print all settings of this scenario as YAML.")
@_json
def scenarios(**options: Any) -> None:
    """List the scenarios that come with the package, or show one with all its settings."""
    _run("scenarios", "scenarios", **options)


@main.command(short_help="Print the body of SCENARIO's plant as URDF.")
@click.argument("scenario", metavar="[SCENARIO]", default="fast_turn_unknown_dynamics")
@_settings
def urdf(**options: Any) -> None:
    """Print the body of SCENARIO's plant as URDF, the robot model that ROS displays and many other tools read.

    Its joints are those of the topic `joint_states`; without SCENARIO it is the skydiver of the paper's fast turn.
    """
    _run("urdf", "urdf", **options)


@main.command(epilog=_EXIT_CODES, short_help="Run SCENARIO in this process, without ROS.")
@_scenario
@_settings
@click.option("--figure", type=_PATH, metavar="FILE.png", help="Draw the run into this PNG, SVG or PDF file.")
@_json
@_quiet
def simulate(**options: Any) -> None:
    """Run SCENARIO in this process, without ROS and without a recording."""
    _run("simulate", "simulate", **options)


@main.command(epilog=_EXIT_CODES, short_help="Run SCENARIO over ROS 2, recorded.")
@click.argument("scenarios", metavar="[NAME=]SCENARIO...", nargs=-1, required=True)
@_settings
@click.option(
    "--out", "folder", type=_PATH, metavar="FOLDER", help="The run folder, instead of a new one below bags/."
)
@click.option("--real-time", is_flag=True, help="Step by the clock instead of waiting for each command.")
@click.option(
    "--delay-steps", default=0, show_default=True, type=_Count(0, 50),
    help="Let the controller predict the state so many steps ahead; a real-time command acts one step later.",
)  # fmt: skip
@_json
@_quiet
def run(**options: Any) -> None:
    """Run SCENARIO over ROS 2, recorded.

    Several scenarios run side by side, each in a namespace with its own clock topic and its own run folder. NAME is
    the namespace, as in anna=turn_360_left; without it: skydiver, skydiver_2 and so on.

    Starts plant, reference, controller and recorder as processes of their own, on a ROS domain of its own
    unless ROS_DOMAIN_ID is set. The run folder holds the bag, the scenario, metrics.json, tracking.png and
    report.html.
    """
    _run("run", "run", **options)


@main.command(short_help="Analyse a run folder again, from its bag.")
@_run_folder
@_json
def analyse(**options: Any) -> None:
    """Make metrics.json, the figures and report.html of the run folder RUN again, from its bag alone."""
    _run("analyse", "print_analysis", **options)


@main.command(short_help="Make the report of a run, or compare several.")
@click.argument("folders", metavar="RUN...", nargs=-1, required=True, type=_PATH)
@click.option("--out", type=_PATH, metavar="FILE.html", help="Write the page here instead of to report.html of"
              " the one RUN, or to comparison.html of several.")  # fmt: skip
def report(**options: Any) -> None:
    """Make the page of the recorded run RUN again, or one that compares several.

    The page is one file that opens offline: metrics, charts with one cursor, the body in 3-D, scenario and versions.
    """
    _run("report", "report", **options)


@main.command(short_help="Write a run as CSV, NPZ or Parquet, or its figure.")
@_run_folder
@click.option("--csv", "forms", flag_value="csv", multiple=True, help="Every step, one row each: run.csv.")
@click.option("--npz", "forms", flag_value="npz", multiple=True, help="The same as NumPy arrays: run.npz.")
@click.option(
    "--parquet",
    "forms",
    flag_value="parquet",
    multiple=True,
    help="The same as Parquet: run.parquet; needs the extra `studies`.",
)
@click.option("--png", "forms", flag_value="png", multiple=True, help="The figure: tracking.png.")
@click.option("--svg", "forms", flag_value="svg", multiple=True, help="The figure as SVG.")
@click.option("--pdf", "forms", flag_value="pdf", multiple=True, help="The figure as PDF.")
@click.option(
    "--out",
    type=_PATH,
    metavar="FOLDER",
    help="Write into this folder, made if missing, instead of into RUN.",
)
def export(**options: Any) -> None:
    """Write the recorded run RUN for other programs; several forms at once, if wanted.

    Columns are time_s, and by their topic and name state/.., command/.., applied_command/.., reference/.., output/..,
    telemetry/.., disturbance/.., solve_time_s and status, in SI units and radians; NaN where a step has no value.
    """
    _run("export", "export", **options)


@main.command(short_help="Estimate the inputs of the run folder RUN.")
@_run_folder
@_json
def inputs(**options: Any) -> None:
    """Estimate the controls of the recorded run RUN from its states, beside what was applied.

    The filter that UTC came from: sigma points of the controls drive the model over 0.25 s to the measured outputs.
    Writes inputs.json and inputs.png into RUN. The states are the recorded estimates of a run on sensors, else the
    true ones. Controls that hardly move the outputs are reported as not seen.
    """
    _run("inputs", "inputs", **options)


@main.command(short_help="Complete a recording that was cut short or damaged.")
@_run_folder
@click.option("--out", type=_PATH, metavar="FOLDER", help="The new folder, instead of RUN_recovered.")
@_json
def recover(**options: Any) -> None:
    """Write the readable messages of the recording RUN into a new run folder; RUN is not changed.

    For a recorder that was killed, which loses at most about the last half second, and for damaged files. Of a
    complete recording nothing is written.
    """
    _run("recover", "recover", **options)


@main.command(epilog=_CHECK_EXIT_CODES, short_help="Play a recorded run again, or check its controller.")
@_run_folder
@click.option(
    "--rate", type=_number, metavar="X", help="Speed, in simulated seconds per second.  [default: 1]"
)
@click.option("--start", type=_number, metavar="S", help="Begin this many seconds after the first message.")
@click.option("--loop", is_flag=True, help="Begin again at the end, until interrupted.")
@click.option(
    "--topics",
    metavar="NAME,...",
    help="Only these topics, and /clock; relative names are in the recorded namespace.",
)
@click.option("--check", is_flag=True, help="Compare the controller's commands with the recorded ones.")
@click.option(
    "--controller", metavar="SCENARIO", help="With --check: the controller of this scenario instead."
)
@_settings
@click.option(
    "--figure",
    type=_PATH,
    metavar="FILE.png",
    help="With --check: draw both commands into this PNG, SVG or PDF file.",
)
@_json
@_quiet
def replay(**options: Any) -> None:
    """Play the recorded run RUN again over ROS 2, or check its controller.

    Publishes the recorded messages in order, byte for byte, with /clock, on ROS_DOMAIN_ID (0 unless set) of this
    machine.

    --check plays nothing and needs no ROS: it feeds the recorded states and reference to the controller of the
    recorded scenario and prints the first command that is not the recorded one, bit for bit. With --controller or
    --set it computes the commands of another controller at these states.
    """
    of_check = {name: options.pop(name) for name in ("controller", "settings", "figure", "as_json")}
    of_player = {name: options.pop(name) for name in ("rate", "start", "loop", "topics", "quiet")}
    checked = options.pop("check")
    given = {
        name: value for name, value in (of_player if checked else of_check).items() if value not in _UNSET
    }
    if given:
        name = {"settings": "set", "as_json": "json"}.get(first := next(iter(given)), first)
        raise click.UsageError(f"--{name} does not go {'with' if checked else 'without'} --check")
    if checked:
        _run("check", "check", **options, **of_check)
    _run("replay", "replay", **options, **of_player)


@main.command(short_help="Show runs, or a flight that you change as it goes on, in a browser.")
@click.argument("runs", metavar="[RUN...]", nargs=-1, type=_PATH)
@click.option(
    "--live", metavar="SCENARIO", help="Fly this scenario in real time; its settings become sliders."
)
@click.option(
    "--ros", metavar="NAMESPACE", help="Show the flight over ROS in this namespace, such as skydiver."
)
@_settings
@click.option(
    "--port", default=8080, show_default=True, type=click.IntRange(1, 65535),
    help="Where the page is served; the next free one if it is taken.",
)  # fmt: skip
def view(**options: Any) -> None:
    """Show the run folders RUN side by side in a browser, or a flight as it goes on, here or over ROS.

    The page has the body in 3-D, the forces on its segments, the wind and its path, and charts of the signals. It is
    served to browsers of this machine only; its address is printed.
    """
    _run("view", "view", **options)


@main.group()
def pattern() -> None:
    """Make and examine postures and movement patterns."""


@pattern.command(short_help="Trim SCENARIO's posture to a straight fall.")
@_scenario
@_settings
@_out_file
@_force
def neutral(**options: Any) -> None:
    """The straight fall nearest to SCENARIO's posture, at its initial pitch, as a posture file."""
    _run("pattern", "neutral", **options)


@pattern.command(short_help="Design a movement pattern for SCENARIO's posture.")
@_scenario
@_settings
@click.option(
    "--kind", type=click.Choice(list(PATTERN_KINDS)), default=DEFAULT_KIND, show_default=True,
    help="Positive alpha turns left, lowers the head, slides to the left, or falls slower.",
)  # fmt: skip
@click.option("--seed", default=1, show_default=True, type=_Count(0), help="Seed of the random starts.")
@_out_file
@_force
def design(**options: Any) -> None:
    """The pattern with the most of the wanted acceleration for the least of any other, as a pattern file."""
    _run("pattern", "design", **options)


@pattern.command(short_help="Show the effect of PATTERN on a straight fall.")
@click.argument("pattern", metavar="PATTERN")
@_within
@_settings
@_json
def show(**options: Any) -> None:
    """Show what PATTERN does to the straight fall of a scenario's posture, at once and when it is held.

    PATTERN is a name below config/patterns, or the path of a YAML file. The posture is first moved, by as little as
    it takes, to fall straight down at the scenario's initial pitch.
    """
    _run("pattern_show", "show", **options)


@pattern.command(short_help="Find the movement patterns of recorded postures.")
@click.argument("source", metavar="SOURCE", type=_PATH)
@click.option(
    "--component",
    default=1,
    show_default=True,
    type=_Count(1),
    help="Which one to write, by falling variance.",
)
@_out_file
@click.option("--mean", type=_PATH, metavar="FILE.yaml", help="Write the mean posture here.")
@_force
@_within
@_settings
@_json
def extract(**options: Any) -> None:
    """Find the movement patterns of recorded postures by principal component analysis.

    SOURCE is a run folder, a bag, an .mcap file, or joint angles in a file of OpenSim (.mot, .sto) or CSV
    (docs/patterns.md); angles that it lacks are those of the scenario's posture. A positive pattern angle has the
    largest of the accelerations about the mean posture positive: it turns left, lowers the head, slides left or
    falls slower.
    """
    _run("pattern_extract", "extract", **options)


@pattern.command("import", short_help="Make a path of measured postures, to be flown.")
@click.argument("source", metavar="FILE", type=_PATH)
@click.option(
    "--out", required=True, type=_PATH, metavar="FILE.yaml",
    help="Write the path here, its first posture beside it.",
)  # fmt: skip
@click.option(
    "--tolerance", default=0.5, show_default=True, type=_number, metavar="DEG",
    help="How far the path may be from a posture that is left out.",
)  # fmt: skip
@_force
@_within
@_settings
def import_(**options: Any) -> None:
    """Make a path of measured postures, to be flown open loop in the time that they were measured in.

    FILE holds joint angles, of OpenSim (.mot, .sto) or as CSV (docs/patterns.md); a run folder or a bag will do, too.
    Angles that it lacks are those of the scenario's posture; angles a few degrees beyond the joint limits are clipped
    and named. As many postures are kept as the tolerance needs; how many, how far the path is from the others and
    how exact the plant's table of it is, is printed with the command that flies it.
    """
    _run("pattern_import", "import_motion", **options)


@main.command(short_help="Find the straight fall of POSTURE, its modes and its turning.")
@click.argument("posture", metavar="[POSTURE]", required=False)
@_within
@_settings
@click.option(
    "--reachable", is_flag=True, help="Also find the largest amplitude of the fast turn that is tracked."
)
@_json
@_quiet
def trim(**options: Any) -> None:
    """Find the straight fall of POSTURE, linearise it, and show how it turns.

    POSTURE is a name below config/postures; --set plant.subject=NAME chooses who falls. The scenario's own posture,
    which is also taken without POSTURE, is first moved, by as little as it takes, to fall straight down at the
    scenario's initial pitch; any other posture is held as it is and may glide. The fast turns of --reachable
    (0.2 Hz, UTC, about a minute of runs) start from the straight fall of the posture, moved so in either case.
    """
    _run("trim", "trim", **options)


@main.command(epilog=_CALIBRATE_EXIT_CODES, short_help="Find a skydiver whose measures meet targets.")
@click.argument("calibration", metavar="CALIBRATION")
@click.option(
    "--out", required=True, type=_PATH, metavar="FOLDER",
    help="Write the skydiver here; a search that was interrupted here is continued.",
)  # fmt: skip
@click.option("--seed", default=1, show_default=True, type=_Count(0), help="Seed of the search.")
@click.option(
    "--evaluations", type=_Count(1), help="How many skydivers to try, instead of the file's number."
)
@_json
@_quiet
def calibrate(**options: Any) -> None:
    """Find a skydiver whose fall, turns and flights meet targets, by changing numbers within bounds.

    CALIBRATION is a name below config/calibrations, or the path of a YAML file (docs/calibrate.md). FOLDER receives
    skydiver.yaml with its suit, subject, posture and pattern, calibration.json, and evaluations.jsonl, from which the
    same command continues.
    """
    _run("calibrate", "calibrate", **options)


@main.command(short_help="Whether UTC is stable around a steady fall, or on a linear plant.")
@click.argument("scenario", metavar="[SCENARIO]", default="fast_turn_unknown_dynamics")
@click.option(
    "--plant", metavar="NAME|FILE.yaml", help="A linear plant instead, see config/linear_plants/admire.yaml."
)
@click.option(
    "--alpha", default=0.0, show_default=True, type=_number, metavar="RAD",
    help="Pattern angle [rad] of the steady turn; 0: the straight fall.",
)  # fmt: skip
@click.option("--steps", type=_Count(1, 500), help="Prediction steps, instead of those of the settings.")
@_settings
@_json
def stability(**options: Any) -> None:
    """Linear theory of UTC: closed-loop eigenvalues, Riccati margin, and the ball of a bounded nonlinearity.

    Around the skydiver's straight fall, or the steady turn at --alpha, of SCENARIO, which must fly UTC with held
    controls (without it: fast_turn_unknown_dynamics); or on a linear plant. Bounds of the controls are left out.
    """
    _run("stability", "stability", **options)


@main.group()
def compare() -> None:
    """Compare this package with the results of others."""


@compare.command(short_help="Run every configuration and check every claim of the paper.")
@_out_folder
@click.option("--quick", is_flag=True, help="Only the first seconds of each run: does it all work?")
@_jobs
@_json
@_quiet
def paper(**options: Any) -> None:
    """Run every configuration of the paper: a table, its figures, and a checklist of its claims.

    FOLDER receives paper.md, details.md, results.json and the figures. Studies found there go into the pages.
    """
    _run("compare", "compare_paper", **options)


@main.group()
def study() -> None:
    """Answer one question with many runs."""


@study.command("run", epilog=_STUDY_EXIT_CODES, short_help="Fly the runs of STUDY that are missing.")
@click.argument("study", metavar="STUDY")
@click.option(
    "--out", type=_PATH, metavar="FOLDER", help="The study's folder, instead of studies/ and its name."
)
@click.option(
    "--workers", default=2, show_default=True, type=_Count(1, 256), help="Local processes that fly."
)
@click.option("--scheduler", metavar="ADDRESS", default="", help="Fly on this Dask cluster instead.")
@click.option(
    "--until", type=click.FloatRange(0.0, 1.0, min_open=True), metavar="WIDTH",
    help="Stop when the 95 % interval of each case's share of successes is this narrow.",
)  # fmt: skip
@_quiet
def study_run(**options: Any) -> None:
    """Fly the runs of STUDY that its folder does not hold yet, and write the report.

    STUDY is a name below config/studies, or the path of a YAML file. FOLDER receives ledger.sqlite, in which every run
    stands as soon as it has ended, report.md with its figure, and runs.parquet (runs.csv without pyarrow). The same
    command continues a study that was interrupted.
    """
    _run("study_run", "run_study", **options)


@study.command("show", epilog=_EXIT_CODES, short_help="Fly one run of a study again.")
@click.argument("study", metavar="STUDY")
@click.argument("number", metavar="RUN", type=_Count(0))
@click.option(
    "--out", type=_PATH, metavar="FOLDER", help="The study's folder, instead of studies/ and its name."
)
@click.option("--record", is_flag=True, help="Fly it over ROS 2 and record it, as `skydiver-utc run` does.")
@_json
@_quiet
def study_show(**options: Any) -> None:
    """Fly one RUN of STUDY, by its number, again: the same numbers as in the ledger, bit for bit.

    FOLDER receives the resolved scenario as run_RUN.yaml.
    """
    _run("study_run", "show_run", **options)


@study.command(short_help="Run with random covariances.")
@click.option(
    "--scenario", "names", multiple=True, show_default=True,
    default=(
        "fast_turn_unknown_dynamics", "fast_turn_pi_dynamics",
        "fast_turn_unknown_dynamics_insensitive", "fast_turn_pi_dynamics_insensitive",
    ),
    metavar="SCENARIO", help="What is tuned. Repeatable.",
)  # fmt: skip
@_settings
@click.option(
    "--factor", "reaches", multiple=True, default=(3.0,), show_default=True,
    type=_Factor(1.0, 100.0, min_open=True),
    help="Largest factor on a covariance, and the inverse of the smallest. Repeatable.",
)  # fmt: skip
@click.option("--count", default=200, show_default=True, type=_Count(2), help="Tunings per scenario.")
@click.option("--seed", default=1, show_default=True, type=_Count(0), help="Seed of the tunings.")
@_out_folder
@_jobs
@_json
@_quiet
def tuning(**options: Any) -> None:
    """Run SCENARIO with random tunings: each covariance times a factor of its own, log-uniform.

    FOLDER receives tuning.json, tuning.png and a table of every run.
    """
    _run("study", "study_tuning", **options)


@study.command(short_help="Run on plants with other numbers.")
@_out_folder
@_jobs
@_quiet
def sensitivity(**options: Any) -> None:
    """Run the paper's configurations with the plant's calibrated numbers 10 % off, one by one and all at once.

    FOLDER receives sensitivity.json. Takes some ten minutes.
    """
    _run("study", "study_sensitivity", **options)


if __name__ == "__main__":
    main()
