# SPDX-License-Identifier: Apache-2.0
"""The command line: help, refusals, output and exit codes."""

import json
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import click
import pytest
import yaml
from command_line import invoke as call
from command_line import refused
from own_slots import cart_file
from recordings import without, write_run
from runs import CART, cart, random_run, run_of

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.cli.main import main
from skydiver_utc.cli.settings import parse_setting
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.parameters import from_yaml, load_scenario, scenario_names

SCENARIO = "slow_turn_pose_only"
SHORT = ("--set", "duration_s=0.1")


def test_every_command_has_help_and_those_that_fly_their_exit_codes() -> None:
    context = click.Context(main)
    commands = [[name] for name in main.list_commands(context)]
    for (name,) in list(commands):
        if isinstance(group := main.get_command(context, name), click.Group):
            commands += [[name, inner] for inner in group.commands]
    assert ["pattern", "import"] in commands
    flying = (["run"], ["simulate"], ["replay"], ["study", "run"])
    for command in [[], *commands]:
        result = call(*command, "--help")
        assert (result.exit_code, result.stdout[:7]) == (0, "Usage: "), command
        assert "exit code" in result.stdout or command not in flying
    assert call("--version").exit_code == 0


def test_help_imports_nothing_but_click() -> None:
    program = (
        "import sys, skydiver_utc.cli.main as cli\n"
        "cli.main(['--help'], standalone_mode=False)\n"
        "heavy = {'numpy', 'numba', 'rclpy', 'matplotlib', 'pydantic', 'yaml', 'rich', 'mcap', 'rosbags'}\n"
        "print(*heavy & set(sys.modules), file=sys.stderr)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "\n")


def test_scenarios_are_listed_with_their_titles() -> None:
    titles = json.loads(call("scenarios", "--json").stdout)
    assert list(titles) == scenario_names()
    assert titles["back_layout"] == load_scenario("back_layout").title
    assert all(titles.values())
    listed = call("scenarios").stdout
    assert all(name in listed for name in titles)
    shown = call("scenarios", "--show", "back_layout").stdout
    assert from_yaml(shown) == load_scenario("back_layout")


def test_the_urdf_is_that_of_the_scenario_s_plant(tmp_path: Path) -> None:
    heavy = ("--set", "plant.subject=heavy")
    robot = ElementTree.fromstring(call("urdf", "back_layout", *heavy).stdout)
    mass = sum(float(mass.attrib["value"]) for mass in robot.iter("mass"))
    assert mass == pytest.approx(
        load_scenario("back_layout", {"plant.subject": "heavy"}).plant.subject.mass_kg
    )
    assert "cart" in refused("urdf", cart_file(tmp_path))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fly", SCENARIO], "fly"),
        (["scenarios", "--show", "nothing"], "nothing"),
        (["simulate"], "SCENARIO"),
        (["simulate", "slow_turn_pose"], "slow_turn_pose_only"),
        (["run", "slow_turn_pose"], "slow_turn_pose_only"),
        (["simulate", "nowhere/nothing.yaml"], "nothing.yaml"),
        (["simulate", SCENARIO, "--figure", "figure.docx"], "png"),
        (["simulate", SCENARIO, "--figure", "nowhere/figure.png"], "nowhere"),
        (["analyse", "nowhere"], "nowhere"),
        (["trim", "boxx"], "'boxx'"),
        (["trim", "--set", "plant.subject=nobody"], "'nobody'"),
        (["trim", "--scenario", "nowhere"], "'nowhere'"),
        (
            ["trim", "head_down", "--set", "plant.posture.joint_angles_deg.left_shoulder=[0, 10, 0]"],
            "head_down",
        ),
        (["pattern", "design", "bank_recovery", "--seed", "-1"], "--seed"),
        *(
            (["simulate", SCENARIO, "--set", setting], words)
            for words, settings in {
                "controller.K_q": ["controller.K_q=1"],
                "NAME=VALUE": ["duration_s", "=1", "duration s=1", "a..b=1", "a=1\nb: 2"],
                "YAML": ["plant.limits.alpha=[1"],
            }.items()
            for setting in settings
        ),
        (["replay", "nowhere", "--check", "--rate", "2"], "--rate"),
        (["replay", "nowhere"], "nowhere"),
        (["replay", "nowhere", "--controller", SCENARIO], "--controller"),
        *((["replay", "nowhere", *given], "--check") for given in (["--json"], ["--check", "--loop"])),
        *((["replay", "nowhere", "--topics", given], "--topics") for given in ("state,", "")),
        *(
            (["view", *given], "--live")
            for given in (
                [],
                ["run", "--live", SCENARIO],
                ["--live", SCENARIO, "--ros", "anna"],
                ["run", "--set", "seed=1"],
            )
        ),
    ],
)
def test_wrong_input_is_refused(arguments: list[str], words: str) -> None:
    assert words in refused(*arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", SCENARIO, "--out", "FOLDER"], "exists"),
        (["analyse", "FOLDER/empty"], "empty"),
        (["analyse", "FOLDER"], "MCAP"),
        (["analyse", "FOLDER/run_0.mcap"], "run folder"),
        (["analyse", "FOLDER/stateless"], "/skydiver/state"),
        *(
            (["pattern", name, "bank_recovery", "--out", "FOLDER/mine.yaml"], "--force")
            for name in ("neutral", "design")
        ),
    ],
)
def test_files_that_do_not_fit_are_refused_and_kept(tmp_path: Path, arguments: list[str], words: str) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "run_0.mcap").write_bytes(b"not MCAP at all")
    (tmp_path / "mine.yaml").write_text("mine", encoding="utf-8")
    write_run(tmp_path / "stateless", random_run(cart()), without("state"))
    sentence = refused(*(word.replace("FOLDER", str(tmp_path)) for word in arguments))
    assert words in sentence
    assert arguments[-1].replace("FOLDER", str(tmp_path)) in sentence
    assert (tmp_path / "mine.yaml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("command", "words"),
    [
        *((command.split(), ("skydiver", "linear")) for command in (
            "trim --scenario CART", "pattern show turn --scenario CART", "pattern neutral CART", "stability CART",
        )),
        (["simulate", "CART"], ("yaw_rate", "place, speed")),
        (["simulate", "CART", "--set", "plant={kind: my_module:MyPlant}"], ("my_module", "PYTHONPATH")),
    ],
)  # fmt: skip
def test_what_another_plant_does_not_have_is_named(
    tmp_path: Path, command: list[str], words: tuple[str, str]
) -> None:
    content = yaml.safe_load(CART) | {"reference": {"kind": "constant", "values": {"yaw_rate": 0.0}}}
    (tmp_path / "cart.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    sentence = refused(*(word.replace("CART", str(tmp_path / "cart.yaml")) for word in command))
    assert all(word in sentence for word in words)


def test_a_setting_is_a_name_and_yaml() -> None:
    assert parse_setting("a.b = [0, 1e-4]") == ("a.b", [0, 1e-4])
    assert parse_setting("a=b=c") == ("a", "b=c")


def test_simulate_prints_a_table_or_one_json_object_and_draws(tmp_path: Path) -> None:
    """Of two settings the last one counts, and a whole number is a float."""
    more = ("--set", "duration_s=0.05", "--set", "controller.K_p=2")
    table = call("simulate", SCENARIO, *SHORT).stdout  # the first run may say that it compiles
    for part in ("completed", "yaw rate: RMSE from 2 s on", "deg/s", "24 steps"):
        assert part in table
    result = call("simulate", SCENARIO, *SHORT, *more, "--json", "--figure", tmp_path / "figure.png")
    assert (result.exit_code, result.stderr) == (0, "")
    values = json.loads(result.stdout)
    assert list(values) == list(metrics(run_of()))
    assert (values["outcome"], values["simulated_time_s"]) == ("completed", pytest.approx(0.0504))
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("ended", Outcome)
def test_the_exit_code_is_that_of_the_end(monkeypatch: pytest.MonkeyPatch, ended: Outcome) -> None:
    run = run_of(outcome=ended)
    monkeypatch.setattr("skydiver_utc.loop.closed_loop.simulate", lambda *_: run)
    result = call("simulate", SCENARIO, "--json")
    code = 0 if ended in (Outcome.COMPLETED, Outcome.ROLLED_OVER) else 1
    assert (result.exit_code, json.loads(result.stdout)["outcome"]) == (code, ended.value)


def test_an_interrupted_command_has_its_own_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("skydiver_utc.loop.closed_loop.simulate", interrupted)
    result = call("simulate", SCENARIO)
    assert (result.exit_code, "Traceback" in result.stderr) == (130, False)


def test_analyse_makes_metrics_figure_and_report_from_the_bag_alone(tmp_path: Path) -> None:
    run = random_run(cart())
    folder = write_run(tmp_path / "run", run, run_id="7")
    printed = call("analyse", folder, "--json").stdout
    of_recording = {"run_id": "7", "ignored_messages": {}, "reference_steps_not_recorded": 0}
    assert json.loads(printed) == {**metrics(run), **of_recording}
    assert (folder / "metrics.json").read_text(encoding="utf-8") == printed
    assert "A cart on rails" in (folder / "report.html").read_text(encoding="utf-8")
    made = [folder / name for name in ("metrics.json", "tracking.png", "report.html")]
    first = [path.read_bytes() for path in made]
    assert "completed" in call("analyse", folder).stdout
    assert [path.read_bytes() for path in made] == first


def test_trim_prints_one_json_object() -> None:
    values = json.loads(call("trim", "--json").stdout)
    assert (values["posture"], values["facing"]) == ("neutral", "belly to earth")
    assert max(values["residual_m_s2"], values["residual_rad_s2"]) < 1e-6
    assert values["glide_angle_deg"] == pytest.approx(0.0, abs=1e-3)
    assert values["pitch_deg"] == pytest.approx(8.0, abs=1e-3)
    assert sum(2 if mode["frequency_hz"] else 1 for mode in values["modes"]) == 8
    assert len(values["turning"]["steady"]) == 4


def test_trim_prints_tables_without_rounding_errors() -> None:
    """The same text in an air whose density differs by a hundred times the machine's precision."""
    airs = ("0.909", "0.90900000000002", "0.90899999999998")
    first, *others = (call("trim", "track", "--set", f"plant.air.density_kg_m3={air}").stdout for air in airs)
    assert others == [first, first]
    for part in ("glide angle", "oscillation", "stable", "turning steady", "yaw rate deg/s", "back to"):
        assert part in first
