"""The command line: its help, its answers to bad input, its output and exit codes."""

import inspect
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from test_analysis_metrics import flight_of
from test_analysis_recorded_flight import flight_with_everything, without, write_bag

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.cli import main
from skydiver_utc.parameters import ParameterError, scenario_names
from skydiver_utc.simulation.outcome import Outcome
from skydiver_utc.verbs.settings import parse_setting

SCENARIO = "slow_turn_pose_only"
SHORT = ("--set", "duration_s=0.1")


# Before click 8.2 stderr came mixed into stdout unless told otherwise.
APART = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}


def call(*arguments: str) -> Result:
    return CliRunner(**APART).invoke(main, arguments)


def refused(*arguments: str) -> str:
    """The sentence with which a call is refused."""
    result = call(*arguments)
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert result.stderr.count("Error: ") == 1
    return result.stderr.partition("Error: ")[2]


def with_setting(setting: str) -> str:
    return refused("simulate", SCENARIO, "--set", setting)


PATTERN = [["pattern", verb] for verb in ("neutral", "design", "show", "extract", "import")]
STUDIES = [["compare", "paper"], ["study", "tuning"], ["study", "guide"]]
FLIGHTS = [["run"], ["simulate"], ["analyse"], ["scenarios"], ["trim"]]


@pytest.mark.parametrize("verb", [[], *FLIGHTS, *PATTERN, *STUDIES])
def test_every_verb_has_help(verb: list[str]) -> None:
    result = call(*verb, "--help")
    assert result.exit_code == 0
    assert result.stdout.startswith("Usage: ")


@pytest.mark.parametrize("verb", ["run", "simulate"])
def test_the_help_of_a_flight_explains_its_exit_codes(verb: str) -> None:
    assert "2  the input is wrong" in call(verb, "--help").stdout


def test_help_loads_nothing_but_click() -> None:
    program = (
        "import sys, skydiver_utc.cli as cli\n"
        "cli.main(['--help'], standalone_mode=False)\n"
        "heavy = {'numpy', 'numba', 'rclpy', 'matplotlib', 'msgspec', 'yaml', 'rich', 'mcap', 'rosbags'}\n"
        "print(*heavy & set(sys.modules), file=sys.stderr)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "\n")


def test_version() -> None:
    assert call("--version").exit_code == 0


def test_scenarios_are_listed_with_their_titles() -> None:
    titles = json.loads(call("scenarios", "--json").stdout)
    assert list(titles) == scenario_names()
    table = call("scenarios").stdout
    assert all(name in table for name in titles)


class TestBadInput:
    """Each is answered by one sentence that names the thing, with exit code 2."""

    def test_unknown_verb(self) -> None:
        assert "No such command 'fly'" in refused("fly", SCENARIO)

    def test_no_scenario(self) -> None:
        assert "Missing argument 'SCENARIO'" in refused("simulate")

    @pytest.mark.parametrize("verb", ["run", "simulate"])
    def test_unknown_scenario(self, verb: str) -> None:
        assert "did you mean slow_turn_pose_only" in refused(verb, "slow_turn_pose")

    def test_missing_scenario_file(self, tmp_path: Path) -> None:
        assert "nothing.yaml" in refused("simulate", str(tmp_path / "nothing.yaml"))

    def test_misspelt_key(self) -> None:
        assert "unknown parameter controller.K_q" in with_setting("controller.K_q=1")

    @pytest.mark.parametrize("value", ["fast", "'1.5'", "true", "", "[1, 2]", "{a: 1}"])
    def test_something_else_for_a_number(self, value: str) -> None:
        assert "controller.K_p" in with_setting(f"controller.K_p={value}")

    @pytest.mark.parametrize("value", [".nan", ".inf", "-.inf"])
    def test_no_finite_number(self, value: str) -> None:
        assert "write a finite number" in with_setting(f"controller.K_p={value}")

    @pytest.mark.parametrize("value", ["-0.0042", "0", "1", "0.0042000001234"])
    def test_impossible_step(self, value: str) -> None:
        assert "dt_s" in with_setting(f"dt_s={value}")

    def test_limits_upside_down(self) -> None:
        assert "limits of alpha are upside down" in with_setting("plant.limits.alpha=[1.5, -1.5]")

    @pytest.mark.parametrize(
        "setting", ["duration_s", "=1", "duration s=1", "a..b=1", "duration_s=1\nseed: 2"]
    )
    def test_setting_without_name_and_value(self, setting: str) -> None:
        assert "write NAME=VALUE" in with_setting(setting)

    def test_setting_that_is_no_yaml(self) -> None:
        assert "not valid YAML" in with_setting("plant.limits.alpha=[1")

    @pytest.mark.parametrize("name", ["figure.pdf", "figure"])
    def test_figure_of_another_kind(self, name: str) -> None:
        assert "end in .png" in refused("simulate", SCENARIO, "--figure", name)

    def test_figure_in_no_folder(self, tmp_path: Path) -> None:
        path = tmp_path / "nowhere" / "figure.png"
        assert f"there is no folder {path.parent}" in refused("simulate", SCENARIO, "--figure", str(path))

    def test_run_folder_that_exists(self, tmp_path: Path) -> None:
        assert f"{tmp_path} exists already" in refused("run", SCENARIO, "--folder", str(tmp_path))

    def test_run_folder_below_a_file(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        assert "cannot be used" in refused("run", SCENARIO, "--folder", str(tmp_path / "file" / "run"))

    def test_run_without_ros(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
        assert "`skydiver-utc simulate`" in refused("run", SCENARIO, "--bags", str(tmp_path))

    def test_run_that_does_not_exist(self, tmp_path: Path) -> None:
        assert "does not exist" in refused("analyse", str(tmp_path / "nothing"))

    def test_folder_that_is_no_bag(self, tmp_path: Path) -> None:
        assert "not a bag" in refused("analyse", str(tmp_path))

    def test_file_that_is_no_bag(self, tmp_path: Path) -> None:
        (tmp_path / "run_0.mcap").write_bytes(b"not MCAP at all")
        assert "is not an MCAP file" in refused("analyse", str(tmp_path))
        assert "give the run folder" in refused("analyse", str(tmp_path / "run_0.mcap"))

    def test_unknown_posture(self) -> None:
        assert "there is no posture 'boxx': choose one of back_to_earth" in refused("trim", "boxx")

    def test_unknown_subject(self) -> None:
        assert "there is no subject 'nobody'" in refused("trim", "--subject", "nobody")

    def test_seed_below_zero(self) -> None:
        assert "--seed" in refused("pattern", "design", "bank_recovery", "--seed", "-1")

    @pytest.mark.parametrize("verb", ["neutral", "design"])
    def test_a_file_that_exists(self, verb: str, tmp_path: Path) -> None:
        (tmp_path / "mine.yaml").write_text("mine", encoding="utf-8")
        sentence = refused("pattern", verb, "bank_recovery", "--out", str(tmp_path / "mine.yaml"))
        assert "mine.yaml exists: choose another file, or add --force" in sentence

    def test_trim_in_an_unknown_scenario(self) -> None:
        assert "there is no scenario 'nowhere'" in refused("trim", "--scenario", "nowhere")

    def test_posture_without_a_straight_fall(self) -> None:
        crooked = "posture.joint_angles_deg.left_shoulder=[0, 10, 0]"
        assert "has no steady straight fall" in refused("trim", "head_down", "--set", crooked)

    def test_bag_of_a_flight_with_holes(self, tmp_path: Path) -> None:
        folder = write_bag(tmp_path / "run", flight_with_everything(), without("state", 17))
        assert "lacks 1 of 81 steps" in refused("analyse", str(folder))


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("a.b=50", ("a.b", 50)),
        ("a.b = 1e-4", ("a.b", 1e-4)),
        ("a=[0, 5.0]", ("a", [0, 5.0])),
        ("a=utc", ("a", "utc")),
        ("a=b=c", ("a", "b=c")),
        ("a=true", ("a", True)),
    ],
)
def test_values_are_yaml(setting: str, expected: tuple[str, object]) -> None:
    assert parse_setting(setting) == expected


def test_a_name_given_twice_by_one_value_is_refused() -> None:
    with pytest.raises(ParameterError, match="stands twice"):
        parse_setting("a={b: 1, b: 2}")


def test_simulate_prints_one_json_object() -> None:
    result = call("simulate", SCENARIO, *SHORT, "--json")
    assert (result.exit_code, result.stderr) == (0, "")
    values = json.loads(result.stdout)
    assert list(values) == list(metrics(flight_of()))
    assert (values["outcome"], values["simulated_time_s"]) == ("completed", pytest.approx(0.1008))


def test_simulate_prints_a_table() -> None:
    result = call("simulate", SCENARIO, *SHORT)
    assert result.exit_code == 0
    for part in ("completed", "RMSE from 2 s on", "deg/s", "24 steps flown"):
        assert part in result.stdout


def test_a_whole_number_will_do_for_a_float() -> None:
    assert call("simulate", SCENARIO, *SHORT, "--set", "controller.K_p=2", "--json").exit_code == 0


def test_the_last_of_two_settings_counts() -> None:
    result = call("simulate", SCENARIO, *SHORT, "--set", "duration_s=0.05", "--json")
    assert json.loads(result.stdout)["simulated_time_s"] == pytest.approx(0.0504)


def test_simulate_draws(tmp_path: Path) -> None:
    figure = tmp_path / "figure.png"
    assert call("simulate", SCENARIO, *SHORT, "--figure", str(figure)).exit_code == 0
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("outcome", "code"),
    [
        (Outcome.COMPLETED, 0),
        (Outcome.ROLLED_OVER, 0),
        (Outcome.DIVERGED, 1),
        (Outcome.NO_COMMAND, 1),
        (Outcome.ABORTED, 1),
    ],
)
def test_the_exit_code_tells_how_the_flight_ended(
    monkeypatch: pytest.MonkeyPatch, outcome: Outcome, code: int
) -> None:
    def flown(*_: Any) -> Any:
        return flight_of(outcome=outcome)

    monkeypatch.setattr("skydiver_utc.verbs.simulate.fly", flown)
    result = call("simulate", SCENARIO, "--json")
    assert (result.exit_code, json.loads(result.stdout)["outcome"]) == (code, outcome.value)


def test_ctrl_c_ends_a_simulation_without_a_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr("skydiver_utc.verbs.simulate.fly", interrupted)
    result = call("simulate", SCENARIO)
    assert (result.exit_code, result.stderr) == (130, "stopped\n")


def test_trim_prints_one_json_object() -> None:
    result = call("trim", "--json")
    assert (result.exit_code, result.stderr) == (0, "")
    values = json.loads(result.stdout)
    assert (values["posture"], values["facing"]) == ("neutral", "belly to earth")
    assert max(values["residual_m_s2"], values["residual_rad_s2"]) < 1e-6
    assert values["glide_angle_deg"] == pytest.approx(0.0, abs=1e-3)
    assert values["pitch_deg"] == pytest.approx(8.0, abs=1e-3)
    assert sum(2 if mode["frequency_hz"] else 1 for mode in values["modes"]) == 8
    assert len(values["turning"]["steady"]) == 4


def test_trim_prints_tables() -> None:
    result = call("trim", "track", "--set", "subject.suit=rig")
    assert result.exit_code == 0
    for part in ("glide angle", "slide oscillation", "stable", "Steady yaw rate", "also falls back to earth"):
        assert part in result.stdout


def test_rounding_errors_do_not_show_in_the_tables_of_trim() -> None:
    """The same text in an air whose density differs by a hundred times the machine's precision."""
    airs = ("0.909", "0.90900000000002", "0.90899999999998")
    texts = {
        call("trim", *names, "--set", f"air.density_kg_m3={air}").stdout
        for names in ((), ("track",))
        for air in airs
    }
    assert len(texts) == 2


def test_trim_falls_straight_whoever_falls() -> None:
    values = json.loads(call("trim", "--set", "subject.mass_kg=65", "--json").stdout)
    assert (values["mass_kg"], values["glide_angle_deg"]) == (pytest.approx(65), pytest.approx(0.0, abs=1e-3))


def test_analyse_makes_metrics_and_figure_from_the_bag_alone(tmp_path: Path) -> None:
    flight = flight_with_everything()
    folder = write_bag(tmp_path / "run", flight)
    printed = call("analyse", str(folder), "--json").stdout
    assert json.loads(printed) == {
        **metrics(flight),
        "ignored_messages": {},
        "reference_steps_not_recorded": 0,
    }
    assert (folder / "metrics.json").read_text(encoding="utf-8") == printed
    made = [folder / name for name in ("metrics.json", "tracking.png", "report.html")]
    first = [path.read_bytes() for path in made]
    assert "completed" in call("analyse", str(folder)).stdout
    assert [path.read_bytes() for path in made] == first


def test_analyse_of_an_aborted_flight_is_no_failure(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "run", flight_with_everything(), without("outcome"))
    result = call("analyse", str(folder), "--json")
    assert (result.exit_code, json.loads(result.stdout)["outcome"]) == (0, "aborted")
