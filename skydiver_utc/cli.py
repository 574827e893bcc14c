"""``skydiver-utc``: one verb per job. Only click loads here; a verb loads its other modules when it is used."""

from pathlib import Path
from typing import Any

import click

from skydiver_utc.plant.pattern_kinds import DEFAULT_KIND, PATTERN_KINDS

_REFUSED = 2
_STOPPED = 130

_EXIT_CODES = """\b
exit code
    0  the flight was flown to its end (outcome completed or rolled_over)
    1  it ended before: diverged, no_command, aborted, or a node failed
    2  the input is wrong: one sentence says what to do, nothing was flown
  130  stopped with Ctrl-C
"""


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
@_scenario
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
    scenario: str,
    settings: tuple[str, ...],
    bags: str,
    folder: str | None,
    real_time: bool,
    delay_steps: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fly SCENARIO over ROS 2, recorded.

    Starts plant, reference, controller and recorder as processes of their own, on a ROS domain of its own
    unless ROS_DOMAIN_ID is set. The run folder holds the bag, the scenario, metrics.json, tracking.png and
    report.html.
    """
    from skydiver_utc.verbs.run import Pace
    from skydiver_utc.verbs.run import run as fly

    place = Path(folder) if folder else None
    raise SystemExit(fly(scenario, settings, Path(bags), place, as_json, quiet, Pace(real_time, delay_steps)))


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


@main.group()
def pattern() -> None:
    """Postures and movement patterns: make them again from the parameters, and see what they do."""


_out = click.option("--out", metavar="FILE.yaml", help="Write here instead of on the screen.")


@pattern.command(short_help="Trim SCENARIO's posture to a straight fall.")
@_scenario
@_settings
@_out
def neutral(scenario: str, settings: tuple[str, ...], out: str | None) -> None:
    """The straight fall nearest to SCENARIO's posture, at its initial pitch, as a posture file."""
    from skydiver_utc.verbs.pattern import neutral as trim

    trim(scenario, settings, Path(out) if out else None)


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
@click.option("--seed", default=1, show_default=True, help="Seed of the random starts.")
@_out
def design(scenario: str, settings: tuple[str, ...], kind: str, seed: int, out: str | None) -> None:
    """The pattern with the most of what is wanted for the least of anything else, as a pattern file."""
    from skydiver_utc.verbs.pattern import design as make

    make(scenario, settings, kind, seed, Path(out) if out else None)


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
@_within
@_settings
@_json
def extract(
    source: str,
    component: int,
    out: str | None,
    mean: str | None,
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
    type=click.FloatRange(min=0.0),
    metavar="DEG",
    help="How far the path may be from a posture that is left out.",
)
@_within
@_settings
def import_(
    source: str, out: str, posture: str | None, tolerance: float, scenario: str, settings: tuple[str, ...]
) -> None:
    """Make a path of measured postures, to be flown open loop in the time that they were measured in.

    FILE.csv holds time_s and joint angles in degrees (docs/patterns.md); a run folder or a bag will do, too. As
    many postures are kept as the tolerance needs; how many, and how far the path is from the others, is printed
    with the command that flies it.
    """
    from skydiver_utc.verbs.pattern_import import import_motion

    import_motion(Path(source), Path(out), posture, tolerance, scenario, settings)


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


@main.command()
@_json
def scenarios(as_json: bool) -> None:
    """List the scenarios that come with the package."""
    from skydiver_utc.verbs.scenarios import scenarios as tell

    tell(as_json)


if __name__ == "__main__":
    main()
