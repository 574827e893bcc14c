# SPDX-License-Identifier: Apache-2.0
"""What a command leaves behind: whole files or none, plain text, and nothing outside of its folder."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import call, invoke
from recordings import write_run
from runs import CART, cart, random_run

from skydiver_utc.parameters import ParameterError, from_yaml
from skydiver_utc.parameters.files import new_folder, write_file

FLOWN = CART.replace("{place: 2.0, speed: 0.0}", "{force: 1.0}")  # open loop


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "cart.yaml"
    path.write_text(FLOWN)
    return path


def test_a_full_disk_leaves_the_old_file_and_one_sentence(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_space(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_space)
    figure = tmp_path / "figure.png"
    figure.write_bytes(b"old")
    result = invoke("simulate", scenario, "--quiet", "--figure", figure)
    assert (result.exit_code, result.stderr.count("\n")) == (1, 1)
    assert str(figure) in result.stderr
    assert "completed" in result.stdout
    assert figure.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 2


def test_a_folder_is_there_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "made") as draft:  # noqa: PT012
        (draft / "part").touch()
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_link_is_replaced_a_pipe_and_a_device_are_written_to(tmp_path: Path) -> None:
    own, link, pipe = (tmp_path / name for name in ("own.txt", "link", "pipe"))
    own.write_text("mine")
    link.symlink_to(own)
    write_file(link, "new")
    assert (own.read_text(), link.read_text(), link.is_symlink()) == ("mine", "new", False)
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    # A terminal of the test's own: code with a fault would replace a device that others need.
    terminal, device = os.openpty()
    for special in (pipe, Path(os.ttyname(device))):
        write_file(special, "new")
    assert os.read(reader, 9) == os.read(terminal, 9) == b"new"
    assert pipe.is_fifo()
    link.unlink()
    link.symlink_to(pipe)
    write_file(link, "own")
    assert link.is_file()
    assert link.read_text() == "own"
    end, write_end = os.pipe()
    write_file(Path(f"/dev/fd/{write_end}"), "new")
    assert os.read(end, 9) == b"new"
    for file in (reader, end, write_end, terminal, device):
        os.close(file)


def test_an_error_names_the_file_that_was_asked_for_or_its_own(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as missing:
        write_file(tmp_path / "none" / "file", "new")
    assert missing.value.filename == str(tmp_path / "none" / "file")
    (tmp_path / "taken" / "within").mkdir(parents=True)
    with pytest.raises(OSError, match="taken") as taken:
        write_file(tmp_path / "taken", "new")
    assert taken.value.filename == str(tmp_path / "taken")
    for error in (OSError(2, "absent", "/other/file"), ValueError("no file")):
        with pytest.raises(type(error)) as own, new_folder(tmp_path / "a" / "made"):
            raise error
        assert own.value is error
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a", "taken", "within"]


@pytest.mark.usefixtures("unrendered")
def test_links_in_a_run_folder_lead_nowhere(tmp_path: Path) -> None:
    own = tmp_path / "own.json"
    own.write_text('{"secret": "1234"}')
    run = write_run(tmp_path / "run", random_run(cart()))
    for name in ("metrics.json", "report.html", "tracking.png", "versions.json", "scenario.yaml"):
        (run / name).symlink_to(own)
    assert invoke("analyse", run).exit_code == 0
    assert own.read_text() == '{"secret": "1234"}'
    assert "1234" not in (run / "report.html").read_text()
    assert json.loads((run / "metrics.json").read_text())["outcome"] == "completed"
    (run / "metadata.yaml").unlink()
    assert invoke("recover", run).exit_code == 0
    assert {path.suffix for path in (tmp_path / "run_recovered").iterdir()} == {".mcap", ".yaml"}
    assert not (tmp_path / "run_recovered" / "scenario.yaml").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.long
def test_a_full_stdout_is_one_sentence(scenario: Path) -> None:
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "skydiver_utc", "simulate", str(scenario), "--quiet", "--json"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "No space" in done.stderr


@pytest.mark.long
def test_a_locale_without_a_character_gets_another_one(scenario: Path) -> None:
    title = "title='Grüße ± ☃'"
    code, stdout, stderr = call("simulate", scenario, "--quiet", "--set", title, PYTHONIOENCODING="ascii")
    assert (code, stderr) == (0, "")
    assert stdout.isascii()


@pytest.mark.parametrize("name", ["[/b]x", "$\\frac$ %s {0}"])
def test_a_name_is_text_everywhere(scenario: Path, tmp_path: Path, name: str) -> None:
    text = FLOWN.replace("name: cart", f"name: {json.dumps(name)}")
    scenario.write_text(text.replace("title: A cart on rails", f"title: {json.dumps(name)}"))
    result = invoke("simulate", scenario, "--figure", tmp_path / "figure.png")
    assert result.exit_code == 0, result.output
    assert name in result.output


@pytest.mark.skipif(shutil.which("script") is None, reason="needs script, which makes a terminal")
@pytest.mark.long
def test_a_name_is_text_at_a_terminal(scenario: Path) -> None:
    scenario.write_text(FLOWN.replace("name: cart", "name: '[/b]x'"))
    script = ["script", "-qec", f"{sys.executable} -m skydiver_utc simulate {scenario}", "/dev/null"]
    done = subprocess.run(script, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert "completed" in done.stdout


@pytest.mark.parametrize("text", ["\x1b[31mred", "a\rb", "\x9b1m", "\u202eabc"])
@pytest.mark.parametrize("field", ["name: cart", "title: A cart on rails", "states: [place, speed]"])
def test_control_characters_are_refused(text: str, field: str) -> None:
    name, _, value = field.partition(": ")
    wrong = f"[place, {json.dumps(text)}]" if value.startswith("[") else json.dumps(text)
    with pytest.raises(ParameterError, match=name) as error:
        from_yaml(CART.replace(field, f"{name}: {wrong}"))
    assert text not in str(error.value)
