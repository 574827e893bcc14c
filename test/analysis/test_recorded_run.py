# SPDX-License-Identifier: Apache-2.0
"""Runs read back from bags that are written here message by message."""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
import yaml
from recordings import (
    JOINTS,
    STRING,
    TRAJECTORY,
    Edit,
    Message,
    added,
    change,
    command,
    named,
    outcome,
    preview,
    since,
    state,
    text,
    without,
    write_run,
)
from runs import cart, random_run

from bags import Record, rewritten
from skydiver_utc.analysis.figures import tracking_figure
from skydiver_utc.analysis.labels import missing
from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.recorded_run import RecordedRun, read_run
from skydiver_utc.errors import AnalysisError, RecordingError
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import to_yaml

ARRAYS = ("states", "commands", "applied", "reference", "telemetry", "solve_time_s", "status")
Write = Callable[..., Path]


def a_run(**fields: object) -> Run:
    """A run of the cart, whose bag is read in no time."""
    return random_run(cart(), **fields)  # type: ignore[arg-type]


@pytest.fixture
def bag(tmp_path_factory: pytest.TempPathFactory) -> Write:
    """Writes a run's bag, after some edits one after the other."""

    def write(run: Run, *edits: Edit, **options: object) -> Path:
        def edit(messages: list[Message]) -> list[Message]:
            return reduce(lambda edited, each: each(edited), edits, messages)

        return write_run(tmp_path_factory.mktemp("bag") / "run", run, edit, **options)  # type: ignore[arg-type]

    return write


@pytest.mark.parametrize("run", [random_run(), random_run(cart())], ids=["odometry", "joint states"])
def test_a_run_comes_back_bit_for_bit(bag: Write, run: Run) -> None:
    back = read_run(bag(run))
    for name in ARRAYS:
        assert np.array_equal(getattr(back, name), getattr(run, name)), name
    for name in ("scenario", "telemetry_names", "tracked_names", "outcome", "reason", "wall_time_s"):
        assert getattr(back, name) == getattr(run, name), name
    assert metrics(back) == metrics(run)


def turned(messages: list[Message]) -> list[Message]:
    """Names in another order."""
    for topic, _, _, message in messages:
        if topic in ("state", "reference/setpoint"):
            message.name, message.position = message.name[::-1], message.position[::-1].copy()
    return messages


@pytest.mark.parametrize(
    "edit",
    [
        turned,
        lambda messages: messages[::-1],
        added(state(a_run(), 7, np.ones(2)), command(a_run(), 7, [0.0])),
    ],
)
def test_names_and_messages_may_come_in_any_order_and_repeated(bag: Write, edit: Edit) -> None:
    run = a_run()
    back = read_run(bag(run, edit))
    for name in ("states", "commands", "reference"):
        assert np.array_equal(getattr(back, name), getattr(run, name)), name


def test_a_namespace_of_any_name_and_a_bare_mcap_file_come_back_but_not_several_namespaces(
    bag: Write,
) -> None:
    run = a_run()
    folder = bag(run, namespaces=("/jump/anna",))
    (folder / "metadata.yaml").unlink()
    assert np.array_equal(read_run(next(folder.glob("*.mcap"))).states, run.states)
    with pytest.raises(RecordingError, match=r"/a, /b"):
        read_run(bag(run, namespaces=("/a", "/b")))


@pytest.mark.parametrize("topic", ["state", "command", "applied_command"])
def test_missing_steps_are_told_and_the_others_count(bag: Write, topic: str) -> None:
    run = a_run()
    back = read_run(bag(run, without(topic, 49, 50, 51, 60)))
    assert back.holes == ((49, 51), (60, 60))
    values = metrics(back)
    assert values["holes_s"] == [[49 * 0.05, 52 * 0.05], [3.0, 3.05]]
    assert "3.000" in missing(values)
    array = {"state": "states", "command": "commands", "applied_command": "applied"}[topic]
    assert np.isnan(getattr(back, array)[50]).all()
    there = np.delete(np.arange(len(getattr(run, array))), [49, 50, 51, 60])
    assert np.array_equal(getattr(back, array)[there], getattr(run, array)[there])
    error = np.delete(run.states[:, 0] - run.reference[:, 0], [49, 50, 51, 60])
    assert values["outputs"]["place"]["rmse"] == pytest.approx(np.sqrt(np.mean(error[40:] ** 2)), rel=1e-12)
    shaded, plain = ([len(axes.patches) for axes in tracking_figure(each).axes] for each in (back, run))
    assert [more - before for more, before in zip(shaded, plain, strict=True)] == [2] * len(plain)


def test_a_recording_without_any_state_is_refused_with_the_reason_of_its_outcome(bag: Write) -> None:
    run = a_run(steps=0, outcome=Outcome.ABORTED, reason="no clock was there")
    with pytest.raises(AnalysisError, match=r"state.*no clock was there"):
        read_run(bag(run, without("state")))


def test_a_recorder_started_during_the_run_gives_the_steps_from_there_on(bag: Write) -> None:
    run = a_run()
    back = read_run(bag(run, since(30)))
    assert (back.first_step, len(back.states), len(back.commands)) == (30, 51, 50)
    for name in ARRAYS:
        assert np.array_equal(getattr(back, name), getattr(run, name)[30:]), name
    assert back.time_s.tolist() == run.time_s[30:].tolist()
    assert read_run(bag(run, since(30), without("command", 40))).holes == ((40, 40),)


def test_the_first_and_the_last_step_are_those_that_every_topic_has(bag: Write) -> None:
    run = a_run()
    first = {"state": 10, "reference/setpoint": 12, "command": 14, "applied_command": 11}
    last = {"state": 52, "command": 47, "applied_command": 47, "reference/setpoint": 30, "outcome": -1}

    def begin(messages: list[Message]) -> list[Message]:
        return [m for m in messages if m[2] >= first.get(m[0], 0)]

    def end(messages: list[Message]) -> list[Message]:
        return [m for m in messages if m[2] <= last.get(m[0], 99)]

    assert read_run(bag(run, begin)).first_step == 14
    recording = RecordedRun(bag(run, end))
    back = recording.run()
    assert np.array_equal(back.states, run.states[:49])
    assert np.array_equal(back.applied, run.applied[:48])
    assert "48 of 80" in back.reason
    assert "state to step 52" in back.reason
    assert (recording.reference_added, len(back.reference)) == (18, 49)
    assert back.outcome is Outcome.ABORTED
    assert [metrics(back)[key] for key in ("wall_time_s", "simulated_time_s")] == [None, 2.4]


@pytest.mark.parametrize(
    "last",
    [
        {"state": 52, "command": 51, "applied_command": 47},
        {"state": 52, "command": 47, "applied_command": 51},
        {"state": 48, "command": 52, "applied_command": 52},
    ],
)
def test_a_recording_without_an_outcome_ends_at_its_shortest_topic(bag: Write, last: dict[str, int]) -> None:
    def end(messages: list[Message]) -> list[Message]:
        return [m for m in messages if m[2] <= last.get(m[0], 99)]

    back = read_run(bag(a_run(), without("outcome"), end))
    assert (len(back.states), len(back.commands), len(back.applied)) == (49, 48, 48)


def test_a_run_without_any_command_has_one_state(bag: Write) -> None:
    run = a_run(steps=0, outcome=Outcome.NO_COMMAND, reason="no usable command came")
    back = read_run(bag(run))
    assert (back.outcome, len(back.states), len(back.commands)) == (Outcome.NO_COMMAND, 1, 0)


def test_the_command_after_the_last_state_of_a_run_that_ended_is_left_out(bag: Write) -> None:
    run = a_run(steps=20, outcome=Outcome.DIVERGED, reason="the state left the model")
    assert np.array_equal(read_run(bag(run, added(command(run, 20, np.zeros(1))))).commands, run.commands)


@pytest.mark.parametrize("steps", [(), (17, 30), tuple(range(30, 81))], ids=["all", "a hole", "the end"])
def test_a_reference_that_is_not_recorded_is_that_of_the_scenario(bag: Write, steps: Sequence[int]) -> None:
    run = a_run()
    recording = RecordedRun(bag(run, without("reference/setpoint", *steps)))
    missing = np.isin(np.arange(81), steps or range(81))[:, np.newaxis]
    back = recording.run()
    assert recording.reference_added == missing.sum()
    assert np.array_equal(back.reference, np.where(missing, [2.0, 0.0], run.reference))


def test_what_a_state_was_pushed_by_acted_at_its_step_only(bag: Write) -> None:
    def pushed(messages: list[Message]) -> list[Message]:
        values = named(cart(), 5, ("place", "speed"), [0.0, 2.0])
        return [*messages, ("pushed", "sensor_msgs/msg/JointState", 5, values)]

    run = read_run(bag(a_run(), pushed))
    assert run.disturbance_names == ("push_speed",)
    assert np.flatnonzero(run.disturbance[:, 0]).tolist() == [5]
    assert run.disturbance[5, 0] == 2.0


def test_telemetry_is_optional(bag: Write) -> None:
    run = a_run()
    bare = read_run(bag(run, without("controller/telemetry")))
    assert (bare.telemetry_names, bare.telemetry.shape) == ((), (80, 0))
    assert metrics(bare)["solve_time_us"] == {"median": None, "p99": None}
    holed = read_run(bag(run, without("controller/telemetry", 5)))
    assert math.isnan(holed.solve_time_s[5])
    assert np.array_equal(np.delete(holed.telemetry, 5, 0), np.delete(run.telemetry, 5, 0))


def test_in_real_time_a_step_without_a_command_has_the_one_before(bag: Write) -> None:
    run = a_run()
    in_real_time = outcome(run, real_time={})
    back = read_run(bag(run, without("command", 17), without("outcome"), added(in_real_time)))
    assert np.array_equal(back.commands[17], run.commands[16])


ALIASES = "a: &a [1]\n" + "".join(
    f"{b}: &{b} [{', '.join(9 * [f'*{a}'])}]\n" for a, b in zip("abcdefghij", "bcdefghijk", strict=True)
)
TEXTS = ["hello", "", "[]", "{}", "\x00", "[" * 20_000, "a: &a [*a]", '{"node": 1, "step": 1e999}']
BEFORE_A_SCENARIO = [
    "extends: " + 300 * "a",
    ALIASES,
    "x: &x {}\ny: *x",
    "# " + 5_000_000 * "a",
    "a: " + 900 * "[" + 900 * "]",
]
NO_CHANGES = [
    change(3, "controller", None, controller__nothing=1),
    change(3, "controller", None, delay_steps=1.5),
    change(3, "controller", None, delay_steps=-1),
    change(3, "controller", [1.0] * 4),
]
NO_MESSAGES = [b"", b"\x00", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + b"\xff" * 60, bytes(range(44, 255))]
KINDS = {"reference": TRAJECTORY, "scenario": STRING, "outcome": STRING}


def left_out() -> Iterator[tuple[str, list[Message]]]:
    """Messages that are none of the run's, by what is wrong with them."""
    run = a_run()
    for since_ns in (1, -(10**9), 5 * 10**9, 3 * 10**17):
        found = [command(run, 3, np.zeros(1)), state(run, 3, run.states[0])]
        for *_, message in found:
            stamp, time_ns = message.header.stamp, run.scenario.stamp_ns(0) + since_ns
            stamp.sec, stamp.nanosec = divmod(time_ns, 10**9)
        yield f"stamp {since_ns}", found
    for values in (np.zeros(3), [], [math.nan]):
        yield f"controls {values}", [command(run, 0, values)]
    yield "states", [("state", JOINTS, 0, named(run.scenario, 0, ["a", "b"], [0.0, 0.0]))]
    yield "run", [outcome(a_run(outcome=Outcome.DIVERGED), "other")]
    yield "changes", NO_CHANGES
    for topic in ("outcome", "scenario", "changes"):
        yield f"texts of {topic}", [(topic, STRING, 80, text(content)) for content in TEXTS]
    for before in BEFORE_A_SCENARIO:
        content = text(f"{before}\n{to_yaml(run.scenario)}")
        yield f"scenario {before[:12]}", [("scenario", STRING, 80, content)]
    for topic in ("scenario", "state", "reference", "command", "outcome", "controller/telemetry"):
        yield f"bytes of {topic}", [(topic, KINDS.get(topic, JOINTS), 3, each) for each in NO_MESSAGES]


@pytest.mark.parametrize("others", [pytest.param(messages, id=name) for name, messages in left_out()])
def test_what_is_no_message_of_the_run_is_left_out_and_counted(bag: Write, others: list[Message]) -> None:
    run = a_run()
    beyond = np.append(
        run.reference[10:], np.full((5, 2), 9.0), axis=0
    )  # the setpoints that are missing, and more
    chunk = "reference", TRAJECTORY, 10, preview(run.scenario, 10, run.tracked_names, beyond)

    def among(messages: list[Message]) -> list[Message]:
        return [messages[0], *others, *messages[1:], chunk, *others]

    folder = bag(run, without("reference/setpoint", 17, 80), among, run_id="mine")
    began = time.monotonic()
    recording = RecordedRun(folder)
    back = recording.run()
    assert time.monotonic() - began < 5.0
    for name in ARRAYS:
        assert np.array_equal(getattr(back, name), getattr(run, name)), name
    assert (back.scenario, back.outcome, back.reason, back.changes) == (
        run.scenario, run.outcome, run.reason, (),
    )  # fmt: skip
    assert recording.run_id == "mine"
    assert recording.ignored == Counter(2 * [message[0] for message in others])


def test_the_later_of_two_changes_of_one_step_counts(bag: Write) -> None:
    run = a_run()
    changes = (change(3, "controller", [0.0], seed=seed) for seed in (1, 2))
    (found,) = read_run(bag(run, added(*changes))).changes
    assert (found.node, found.step, found.of_scenario) == ("controller", 3, {"seed": 2})


def test_a_bag_of_something_else_is_refused(bag: Write, tmp_path: Path) -> None:
    for others in ([], [("scenario", STRING, 0, text("name: something"))]):
        with pytest.raises(AnalysisError, match="scenario"):
            read_run(bag(a_run(), without("scenario"), added(*others)))
    for path in (tmp_path / "nothing", tmp_path):
        with pytest.raises(RecordingError):
            read_run(path)


@pytest.mark.parametrize(("kind", "words"), [("lost:Wave", "lost.py"), ("antigravity:Wave", "antigravity")])
def test_an_own_class_that_cannot_be_imported_is_named_with_its_module(
    bag: Write, kind: str, words: str
) -> None:
    content = yaml.safe_load(to_yaml(a_run().scenario)) | {"reference": {"kind": kind}}
    recorded: Message = ("scenario", STRING, 0, text(yaml.safe_dump(content)))
    with pytest.raises(AnalysisError, match=words) as error:
        read_run(bag(a_run(), without("scenario"), added(recorded)))
    assert "versions.json" not in str(error.value)


def test_no_file_is_read_that_a_recording_names(bag: Write, tmp_path: Path) -> None:
    run = random_run()
    posture = tmp_path / "mine.yaml"
    own = run.scenario.plant.posture.as_dict() | {"description": "secret"}
    posture.write_text(yaml.safe_dump(own))
    recorded = yaml.safe_load(to_yaml(run.scenario))
    recorded["plant"]["posture"] = str(posture)
    values = {"plant.posture": posture, "plant.skydiver": posture, "plant.kind": "skydiver"}
    changes = [change(3, "controller", None, **{name: str(values[name])}) for name in values]
    named: Message = ("scenario", STRING, 0, text(yaml.safe_dump(recorded)))
    recording = RecordedRun(bag(run, added(named, *changes)))
    assert recording.run().changes == ()
    assert recording.ignored == {"scenario": 1, "changes": 3}
    assert "secret" not in to_yaml(recording.scenario)


def test_an_impossible_time_is_counted(bag: Write, tmp_path: Path) -> None:
    run = a_run()

    def edit(record: Record) -> Record:
        if record[1].topic.endswith("/command") and record[2].log_time == run.scenario.stamp_ns(7):
            record[2].publish_time = 2**64 - 1000
        return record

    recording = RecordedRun(rewritten(bag(run), tmp_path / "edited" / "run_0.mcap", edit))
    assert recording.run().holes == ((7, 7),)
    assert recording.ignored == {"command": 1}
