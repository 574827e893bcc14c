"""``skydiver-utc``: one verb per job. Only click loads here; a verb loads its other modules when it is used."""

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from skydiver_utc.plant.pattern_kinds import DEFAULT_KIND, PATTERN_KINDS

_REFUSED = 2
_STOPPED = 130

_EXIT_CODES = """\b
exit code
    0  the flight was flown to its end (outcome completed or rolled_over)
    1  it ended before: diverged, no_command, no_clock, aborted, or a node failed
    2  the input is wrong: one sentence says what to do, nothing was flown
  130  stopped with Ctrl-C
"""


_CHECK_EXIT_CODES = """\b
exit code of --check
    0  every command is the recorded one
    1  some are not
    2  the input is wrong: one sentence says what to do
"""


_OF_PLAYING = ("rate", "start", "loop", "paused", "topics", "quiet")


class Verbs(click.Group):
    """Turns the errors of bad input into one sentence; any other error is a fault of the program."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except KeyboardInterrupt:
            click.echo("stopped", err=True)
            ctx.exit(_STOPPED)
        except _errors_of_input() as error:
            if isinstance(error, OSError) and error.filename is None:
                raise
            click.echo(f"Error: {_sentence(error)}", err=True)
            ctx.exit(getattr(error, "exit_code", _REFUSED))


def _errors_of_input() -> tuple[type[Exception], ...]:
    """Evaluated only when an error is on its way."""
    from skydiver_utc.analysis.errors import AnalysisError
    from skydiver_utc.parameters import ParameterError
    from skydiver_utc.recording.errors import RecordingError
    from skydiver_utc.verbs.errors import VerbError

    return (ParameterError, RecordingError, AnalysisError, VerbError, OSError)


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"{error.filename} cannot be used ({error.strerror}): choose another path, or mend this one"
    return str(error)


def _show_version(ctx: click.Context, _parameter: click.Parameter, asked: bool) -> None:
    if asked:
        from importlib.metadata import PackageNotFoundError, version

        try:
            click.echo(version("skydiver_utc"))
        except PackageNotFoundError:
            click.echo("not installed, used from a checkout")
        ctx.exit()


_version = click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_show_version,
    help="Show the version and exit.",
)
_scenario = click.argument("scenario", metavar="SCENARIO")
_settings = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="Override one parameter by its dotted name, for example controller.horizon_steps=5. Repeatable.",
)
_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of a table.")
_within = click.option(
    "--scenario",
    default="bank_recovery",
    show_default=True,
    help="Where all that is not named comes from: air, limits, subject.",
)
_quiet = click.option("--quiet", is_flag=True, help="No progress bar, nothing on stderr but errors.")


@click.group(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@_version
def main() -> None:
    """A virtual skydiver flown by the Unscented Transform Controller.

    SCENARIO is a name that `skydiver-utc scenarios` lists, or the path of a YAML file.
    """


@main.command(epilog=_EXIT_CODES, short_help="Fly SCENARIO over ROS 2, recorded.")
@click.argument("scenarios", metavar="[NAME=]SCENARIO...", nargs=-1, required=True)
@_settings
@click.option(
    "--bags", default="bags", show_default=True, metavar="FOLDER", help="Where run folders are made."
)
@click.option("--folder", metavar="FOLDER", help="The run folder itself, instead of a new one in --bags.")
@click.option("--real-time", is_flag=True, help="Step by the clock instead of waiting for each command.")
@click.option(
    "--delay-steps",
    default=0,
    show_default=True,
    type=click.IntRange(0, 50),
    help="Let the controller predict the state so many steps ahead; a real-time command acts one step later.",
)
@_json
@_quiet
def run(
    scenarios: tuple[str, ...],
    settings: tuple[str, ...],
    bags: str,
    folder: str | None,
    real_time: bool,
    delay_steps: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fly SCENARIO over ROS 2, recorded.

    Several scenarios are flown by several skydivers at once, under one clock. A skydiver's name is the namespace of
    its nodes: skydiver, skydiver_2 and so on unless it is given, as in anna=turn_360_left. Each has a run folder.

    Starts plant, reference, controller and recorder as processes of their own, on a ROS domain of its own
    unless ROS_DOMAIN_ID is set. The run folder holds the bag, the scenario, metrics.json, tracking.png and
    report.html.
    """
    from skydiver_utc.verbs.run import Pace
    from skydiver_utc.verbs.run import run as fly

    place = Path(folder) if folder else None
    raise SystemExit(
        fly(scenarios, settings, Path(bags), place, as_json, quiet, Pace(real_time, delay_steps))
    )


@main.command(epilog=_EXIT_CODES, short_help="Fly SCENARIO in this process, without ROS.")
@_scenario
@_settings
@click.option("--figure", metavar="FILE.png", help="Draw the flight into this file.")
@_json
@_quiet
def simulate(
    scenario: str, settings: tuple[str, ...], figure: str | None, as_json: bool, quiet: bool
) -> None:
    """Fly SCENARIO in this process, without ROS and without a recording."""
    from skydiver_utc.verbs.simulate import simulate as fly

    raise SystemExit(fly(scenario, settings, Path(figure) if figure else None, as_json, quiet))


@main.command(short_help="Analyse a run folder again, from its bag.")
@click.argument("run_folder", metavar="RUN")
@_json
def analyse(run_folder: str, as_json: bool) -> None:
    """Make metrics.json, tracking.png and report.html of the run folder RUN again, from its bag alone."""
    from skydiver_utc.verbs.analyse import analyse as look

    look(Path(run_folder), as_json)


@main.command(short_help="Make a whole bag of a recording that was cut short.")
@click.argument("run_folder", metavar="RUN")
@click.option("--out", metavar="FOLDER", help="The new folder, instead of RUN_recovered.")
@_json
def recover(run_folder: str, out: str | None, as_json: bool) -> None:
    """Make a whole bag of the recording RUN, whose recorder was killed or whose file is damaged.

    Everything that can be read goes into a new run folder; RUN stays as it is. A recorder that was killed leaves
    all but about its last half second. A bag that is whole is told so, and nothing is written.
    """
    from skydiver_utc.verbs.recover import recover as save

    save(Path(run_folder), Path(out) if out else None, as_json)


@main.command(epilog=_CHECK_EXIT_CODES, short_help="Play a recorded run again, or check its controller.")
@click.argument("run_folder", metavar="RUN")
@click.option("--rate", default=1.0, show_default=True, help="Speed, in simulated seconds per second.")
@click.option("--start", default=0.0, metavar="S", help="Begin this many seconds after the first message.")
@click.option("--loop", is_flag=True, help="Begin again at the end, until interrupted.")
@click.option(
    "--paused", is_flag=True, help="Wait for the space bar, or the service, before the first message."
)
@click.option(
    "--topics", metavar="NAME,...", help="Only these topics, and /clock; state is that of the skydiver."
)
@click.option("--check", is_flag=True, help="Compare the controller's answers with the recorded commands.")
@click.option(
    "--controller", metavar="SCENARIO", help="With --check: ask this scenario's controller instead of RUN's."
)
@_settings
@click.option("--figure", metavar="FILE.png", help="With --check: draw both commands into this file.")
@_json
@_quiet
def replay(
    run_folder: str,
    rate: float,
    start: float,
    loop: bool,
    paused: bool,
    topics: str | None,
    check: bool,
    controller: str | None,
    settings: tuple[str, ...],
    figure: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Play the recorded run RUN again over ROS 2, or check its controller.

    Publishes the recorded messages in order, byte for byte, with /clock, on ROS_DOMAIN_ID (0 unless set) of this
    machine. The space bar pauses and goes on, and so does the service /player/pause (std_srvs/SetBool).

    --check plays nothing and needs no ROS: it feeds the recorded states and reference to the controller of the
    recorded scenario and tells the first command that is not the recorded one, bit for bit. With --controller or
    --set it asks another controller what it would have done at these states.
    """
    if check:
        source = click.get_current_context().get_parameter_source
        if any(source(name) is not ParameterSource.DEFAULT for name in _OF_PLAYING):
            raise click.UsageError(
                "--rate, --start, --loop, --paused, --topics and --quiet do not go with --check"
            )
        from skydiver_utc.verbs.check import check as ask

        path = Path(figure) if figure else None
        raise SystemExit(ask(Path(run_folder), controller, settings, path, as_json))
    if controller or settings or figure or as_json:
        raise click.UsageError("--controller, --set, --figure and --json go with --check")
    from skydiver_utc.verbs.replay import replay as play

    names = [] if topics is None else [name.strip() for name in topics.split(",")]
    if not all(names):
        raise click.UsageError(f"--topics {topics!r} has an empty name: write them as in state,command")
    raise SystemExit(play(Path(run_folder), rate, start, loop, paused, names, quiet))


@main.group()
def pattern() -> None:
    """Postures and movement patterns: make them again from the parameters, and see what they do."""


_out = click.option("--out", metavar="FILE.yaml", help="Write here instead of on the screen.")
_force = click.option("--force", is_flag=True, help="Write over files that exist.")


@pattern.command(short_help="Trim SCENARIO's posture to a straight fall.")
@_scenario
@_settings
@_out
@_force
def neutral(scenario: str, settings: tuple[str, ...], out: str | None, force: bool) -> None:
    """The straight fall nearest to SCENARIO's posture, at its initial pitch, as a posture file."""
    from skydiver_utc.verbs.pattern import neutral as trim

    trim(scenario, settings, Path(out) if out else None, force)


@pattern.command(short_help="Design a movement pattern for SCENARIO's posture.")
@_scenario
@_settings
@click.option(
    "--kind",
    type=click.Choice(list(PATTERN_KINDS)),
    default=DEFAULT_KIND,
    show_default=True,
    help="Positive alpha turns left, lowers the head, slides to the left, or falls slower.",
)
@click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Seed of the random starts."
)
@_out
@_force
def design(
    scenario: str, settings: tuple[str, ...], kind: str, seed: int, out: str | None, force: bool
) -> None:
    """The pattern with the most of what is wanted for the least of anything else, as a pattern file."""
    from skydiver_utc.verbs.pattern import design as make

    make(scenario, settings, kind, seed, Path(out) if out else None, force)


@pattern.command(short_help="Tell what PATTERN does to a straight fall.")
@click.argument("name", metavar="PATTERN")
@_within
@_settings
@_json
def show(name: str, scenario: str, settings: tuple[str, ...], as_json: bool) -> None:
    """Tell what PATTERN does to the straight fall of a scenario's posture, at once and when it is held.

    PATTERN is a name below config/patterns, or the path of a YAML file. The posture is first moved, by as little as
    it takes, to fall straight down at the scenario's initial pitch.
    """
    from skydiver_utc.verbs.pattern_show import show as tell

    tell(name, scenario, settings, as_json)


@pattern.command(short_help="Find the movement patterns of recorded postures.")
@click.argument("source", metavar="SOURCE")
@click.option("--component", default=1, show_default=True, help="Which one to write, by falling variance.")
@_out
@click.option("--mean", metavar="FILE.yaml", help="Write the mean posture here.")
@_force
@_within
@_settings
@_json
def extract(
    source: str,
    component: int,
    out: str | None,
    mean: str | None,
    force: bool,
    scenario: str,
    settings: tuple[str, ...],
    as_json: bool,
) -> None:
    """Find the movement patterns of recorded postures by principal component analysis.

    SOURCE is a run folder, a bag, an .mcap file, or a CSV file of joint angles (docs/patterns.md); angles that it
    lacks are those of the scenario's posture. A positive pattern angle has the largest of the
    accelerations about the mean posture positive: it turns left, lowers the head, slides left or falls slower.
    """
    from skydiver_utc.verbs.pattern_extract import extract as find

    find(
        Path(source),
        component,
        scenario,
        settings,
        Path(out) if out else None,
        Path(mean) if mean else None,
        force,
        as_json,
    )


@pattern.command("import", short_help="Make a path of measured postures, to be flown.")
@click.argument("source", metavar="FILE.csv")
@click.option(
    "--out", required=True, metavar="FILE.yaml", help="Write the path here, its first posture beside it."
)
@click.option("--posture", metavar="NAME", help="Whose joint angles are taken where the file has none.")
@click.option(
    "--tolerance",
    default=0.5,
    show_default=True,
    type=float,
    metavar="DEG",
    help="How far the path may be from a posture that is left out.",
)
@_force
@_within
@_settings
def import_(
    source: str,
    out: str,
    posture: str | None,
    tolerance: float,
    force: bool,
    scenario: str,
    settings: tuple[str, ...],
) -> None:
    """Make a path of measured postures, to be flown open loop in the time that they were measured in.

    FILE.csv holds time_s and joint angles in degrees (docs/patterns.md); a run folder or a bag will do, too. As
    many postures are kept as the tolerance needs; how many, how far the path is from the others and how
    exact the plant's table of it is, is printed with the command that flies it.
    """
    from skydiver_utc.verbs.pattern_import import import_motion

    import_motion(Path(source), Path(out), posture, tolerance, scenario, settings, force)


@main.command(short_help="Find the straight fall of POSTURE, its modes and its turning.")
@click.argument("posture", metavar="[POSTURE]", required=False)
@click.option("--subject", metavar="NAME", help="Who falls, instead of the scenario's subject.")
@_within
@_settings
@click.option(
    "--reachable",
    is_flag=True,
    help="Fly fast turns of growing amplitude, too, and tell the largest one tracked.",
)
@_json
@_quiet
def trim(
    posture: str | None,
    subject: str | None,
    scenario: str,
    settings: tuple[str, ...],
    reachable: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Find the straight fall of POSTURE, linearise it, and tell how it turns.

    POSTURE is a name below config/postures. The scenario's own posture, which is also taken without POSTURE, is
    first moved, by as little as it takes, to fall straight down at the scenario's initial pitch; any other posture
    is held as it is and may glide. The fast turns of --reachable (0.2 Hz, UTC, about a minute of flights) start
    from the straight fall of the posture, moved so in either case.
    """
    from skydiver_utc.verbs.trim import trim as tell

    tell(posture, subject, scenario, settings, reachable, as_json, quiet)


@main.command(short_help="Tell whether UTC is stable around a steady fall, or on a linear plant.")
@click.argument("scenario", metavar="[SCENARIO]", default="fast_turn_unknown_dynamics")
@click.option(
    "--plant", metavar="NAME|FILE.yaml", help="A linear plant instead, as config/plants/admire.yaml shows."
)
@click.option(
    "--alpha",
    default=0.0,
    show_default=True,
    help="Pattern angle [rad] of the steady turn; 0: the straight fall.",
)
@click.option("--steps", type=click.IntRange(1, 500), help="Prediction steps, instead of those written down.")
@_settings
@_json
def stability(
    scenario: str,
    plant: str | None,
    alpha: float,
    steps: int | None,
    settings: tuple[str, ...],
    as_json: bool,
) -> None:
    """Linear theory of UTC: closed-loop eigenvalues, Riccati margin, and the ball of a bounded nonlinearity.

    Around the skydiver's straight fall, or the steady turn at --alpha, of SCENARIO, which must fly UTC with held
    controls (without it: fast_turn_unknown_dynamics); or on a linear plant. Bounds of the controls are left out.
    """
    from skydiver_utc.verbs.stability import stability as tell

    tell(scenario, plant, settings, alpha, steps, as_json)


_jobs = click.option(
    "--jobs",
    default=2,
    show_default=True,
    type=click.IntRange(1),
    help="Processes that fly at the same time.",
)
_out_folder = click.option(
    "--out", metavar="FOLDER", help="Write files into this folder, made if it is not there."
)


@main.group()
def compare() -> None:
    """Put this package beside others' results."""


@compare.command(short_help="Fly all that the paper shows and claims.")
@_out_folder
@click.option("--quick", is_flag=True, help="Only the first seconds of each flight: does it all work?")
@_jobs
@_json
@_quiet
def paper(out: str | None, quick: bool, jobs: int, as_json: bool, quiet: bool) -> None:
    """Fly every configuration of the paper: a table, its figures, and a checklist of its claims.

    FOLDER receives paper.md, results.json and the figures. A tuning study found there goes into the page.
    """
    from skydiver_utc.verbs.compare import compare_paper

    compare_paper(Path(out) if out else None, quick, jobs, as_json, quiet)


@main.group()
def study() -> None:
    """Answer one question with many flights."""


@study.command(short_help="Fly with random covariances.")
@click.option(
    "--scenario",
    "names",
    multiple=True,
    default=("fast_turn_unknown_dynamics", "fast_turn_pi_dynamics"),
    show_default=True,
    metavar="SCENARIO",
    help="What is tuned. Repeatable.",
)
@_settings
@click.option(
    "--factor",
    "reaches",
    multiple=True,
    default=(10.0, 3.0),
    show_default=True,
    type=click.FloatRange(1.0, 100.0, min_open=True),
    help="Largest factor on a covariance, and the inverse of the smallest. Repeatable.",
)
@click.option("--count", default=500, show_default=True, type=click.IntRange(2), help="Tunings per scenario.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help="Seed of the tunings.")
@_out_folder
@_jobs
@_json
@_quiet
def tuning(
    names: tuple[str, ...],
    settings: tuple[str, ...],
    reaches: tuple[float, ...],
    count: int,
    seed: int,
    out: str | None,
    jobs: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fly SCENARIO with random tunings: each covariance times a factor of its own, log-uniform.

    FOLDER receives tuning.json, tuning.png and a table of every flight.
    """
    from skydiver_utc.verbs.study import study_tuning

    study_tuning(names, settings, reaches, count, seed, Path(out) if out else None, jobs, as_json, quiet)


@study.command(short_help="Draw the figures of the tuning guide.")
@click.option(
    "--out", required=True, metavar="FOLDER", help="Write the figures here; made if it is not there."
)
@_jobs
@_quiet
def guide(out: str, jobs: int, quiet: bool) -> None:
    """Fly the right and the wrong settings of each step of docs/tuning.md, and draw their telemetry."""
    from skydiver_utc.verbs.study import study_guide

    study_guide(Path(out), jobs, quiet)


@main.command()
@_json
def scenarios(as_json: bool) -> None:
    """List the scenarios that come with the package."""
    from skydiver_utc.verbs.scenarios import scenarios as tell

    tell(as_json)


if __name__ == "__main__":
    main()
