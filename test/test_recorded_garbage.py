"""Bytes that are no message, on each recorded topic, and every reader of recordings: it skips and counts them."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from test_analysis_recorded_flight import STORE, TYPES, Message, text
from test_controller_check import SCENARIO, with_previews, write_bag

from skydiver_utc.cli import main
from skydiver_utc.parameters import load_scenario
from skydiver_utc.recording.playback import in_order
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.flight import Flight

DURATION_S = 0.4
STRING = "std_msgs/msg/String"
CHANGE = {"node": "plant", "step": 3, "parameters": {"air.density_kg_m3": 1.2}, "control": None}
# The readers of a flight look at these; the others are only handed on.
LOOKED_AT = [
    *(
        "scenario",
        "state",
        "reference",
        "reference/setpoint",
        "changes",
        "command",
        "applied_command",
        "outcome",
    ),
    "controller/telemetry",
]
TOPICS = [*LOOKED_AT, "joint_states", "diagnostics"]


@pytest.fixture(scope="module")
def flight() -> Flight:
    return simulate(load_scenario(SCENARIO, {"duration_s": DURATION_S}))


def everything(flight: Flight, messages: list[Message]) -> list[Message]:
    """A message on every recorded topic, and a setpoint that only the preview tells."""
    joints = next(m for m in messages if m[0] == "applied_command")
    status = TYPES["diagnostic_msgs/msg/DiagnosticArray"](joints[3].header, [])
    more = [("changes", STRING, 3, text(json.dumps(CHANGE))), ("joint_states", *joints[1:])]
    more += [("diagnostics", "diagnostic_msgs/msg/DiagnosticArray", 0, status)]
    own = [m for m in messages if m[:3:2] != ("reference/setpoint", 20)]
    return [*with_previews(flight)(own), *more]


def garbage(cdr: bytes) -> Iterator[bytes]:
    """Nothing, halves, lengths that are not true, zeros, noise."""
    random = np.random.default_rng(3)
    head = cdr[:4]
    yield from (b"", cdr[:1], head, cdr[:7], cdr[: len(cdr) // 2], head + b"\xff" * 60, head + bytes(600))
    for size in (1, 5, 40, 300, 2000):
        yield random.bytes(size)
        yield head + random.bytes(size)


class Bags:
    """The flight's bag, and the same with garbage on one topic."""

    def __init__(self, flight: Flight, folder: Path) -> None:
        self._flight, self._folder = flight, folder
        self.clean = write_bag(folder / "clean", flight, lambda m: everything(flight, m))

    def with_garbage(self, name: str) -> tuple[Path, int]:
        """The bag, made once, and how many messages of it are none."""
        count = 0

        def edit(messages: list[Message]) -> list[Message]:
            nonlocal count
            own = everything(self._flight, messages)
            kind, message = next(m[1::2] for m in own if m[0] == name)
            strange = list(garbage(bytes(STORE.serialize_cdr(message, kind))))
            count = 3 * len(strange)
            early, middle, late = ([(name, kind, k, each) for each in strange] for k in (0, 30, 71))
            return [*early, *own[: len(own) // 2], *middle, *own[len(own) // 2 :], *late]

        folder = self._folder / name.replace("/", "_")
        return write_bag(folder, self._flight, edit), count


@pytest.fixture(scope="module")
def bags(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Bags:
    return Bags(flight, tmp_path_factory.mktemp("garbage"))


@pytest.fixture(scope="module", params=TOPICS)
def spoilt(request: pytest.FixtureRequest, bags: Bags) -> tuple[str, Path, int]:
    return request.param, *bags.with_garbage(request.param)


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, list(map(str, arguments)))


def test_analyse_leaves_it_out_and_counts_it(bags: Bags, spoilt: tuple[str, Path, int]) -> None:
    name, folder, count = spoilt
    clean, found = (call("analyse", path, "--json") for path in (bags.clean, folder))
    assert found.exit_code == 0, found.output
    values, wanted = json.loads(found.stdout), json.loads(clean.stdout)
    assert values.pop("ignored_messages") == ({name: count} if name in LOOKED_AT else {})
    assert wanted.pop("ignored_messages") == {}
    assert values == wanted
    told = call("analyse", folder)
    assert (f"{count} on {name}" in told.output) == (name in LOOKED_AT)


def test_check_finds_the_recorded_answers(bags: Bags, spoilt: tuple[str, Path, int]) -> None:
    _, folder, _ = spoilt
    result = call("replay", folder, "--check", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout) == json.loads(call("replay", bags.clean, "--check", "--json").stdout)


def test_recover_keeps_it_byte_for_byte(spoilt: tuple[str, Path, int], tmp_path: Path) -> None:
    _, folder, _ = spoilt
    cut = tmp_path / "cut"
    cut.mkdir()
    (file,) = folder.glob("*.mcap")
    (cut / file.name).write_bytes(file.read_bytes()[:-8])
    result = call("recover", cut, "--out", tmp_path / "whole", "--json")
    assert result.exit_code == 0, result.output
    assert contents(tmp_path / "whole") == contents(folder)


def contents(folder: Path) -> dict[str, list[bytes]]:
    return {name: topic.cdr for name, topic in read_bag(folder).items()}


def test_what_is_played_has_it_byte_for_byte(spoilt: tuple[str, Path, int]) -> None:
    name, folder, count = spoilt
    topic = f"/skydiver/{name}"
    played = [item.cdr for item in in_order(read_bag(folder)) if item.topic == topic]
    assert sorted(played) == sorted(contents(folder)[topic])
    assert len(played) > count


@pytest.mark.parametrize("name", ["state", "scenario", "command"])
def test_a_topic_of_nothing_else_is_refused_in_one_sentence(
    flight: Flight, tmp_path: Path, name: str
) -> None:
    def edit(messages: list[Message]) -> list[Message]:
        return [(*m[:3], b"\x00\x01\x00\x00") if m[0] == name else m for m in messages]

    folder = write_bag(tmp_path / "bag", flight, edit)
    for arguments in (("analyse", folder), ("replay", folder, "--check")):
        result = call(*arguments)
        assert result.exit_code == 2
        assert result.output.startswith("Error: ")
        assert result.output.count("\n") == 1 or "Traceback" not in result.output
        assert name in result.output
