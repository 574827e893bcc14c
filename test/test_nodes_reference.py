"""The reference node against a partner that plays the plant's clock."""

import json
from typing import Any

import pytest
from ros_fixtures import Partner, Ros, overrides
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.messages import ClockWriter
from skydiver_utc.nodes.preview import read_preview
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.nodes.roll_call import Claim
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.build import build_controller, build_reference

pytest_plugins = ("ros_fixtures",)

CHUNK = 10
PREVIEW = load_scenario("fast_turn_unknown_dynamics").preview_steps


class Stage:
    """A reference node with short chunks, and the clock that a test turns."""

    def __init__(self, ros: Ros, **parameters: object) -> None:
        self.ros = ros
        given = {"chunk_steps": CHUNK} | parameters
        self.node: ReferenceNode = ros.add(ReferenceNode(ros.context, overrides(**given)))  # type: ignore[arg-type]
        self.plant: Partner = ros.partner("plant")
        self.setpoints = self.plant.hear(topics.SETPOINT)
        self.chunks = self.plant.hear(topics.REFERENCE_PREVIEW)
        self.plant.hear(topics.CHANGES)
        self.write = ClockWriter(self.node.grid).fill

    def turn_to(self, *steps: int) -> None:
        """Send the clock of these steps and wait for their setpoints."""
        for k in steps:
            expected = len(self.setpoints) + 1
            self.plant.sends(topics.CLOCK).publish(self.write(k))
            self.ros.spin_until(lambda expected=expected: len(self.setpoints) >= expected)  # type: ignore[misc]

    def claim(self, serving: bool) -> None:
        """The plant says that it is there, and whether its flight goes on."""
        claim = Claim("plant", "a", 1, serving, 1, "here", scenario="0")
        self.plant.sends(topics.ROLL_CALL).publish(String(data=json.dumps(claim._asdict())))

    def begun(self) -> "Stage":
        self.plant.sends(topics.CLOCK)
        self.claim(serving=False)
        self.ros.spin_until(lambda: self.chunks)
        return self

    def first_steps(self) -> list[int]:
        return [read_preview(chunk, self.node.grid, "yaw_rate")[0] for chunk in self.chunks]


@pytest.fixture
def stage(ros: Ros) -> Stage:
    return Stage(ros, duration_s=1.0)


def test_the_first_chunk_comes_when_there_is_a_clock(stage: Stage) -> None:
    stage.ros.spin_for(0.2)
    assert stage.chunks == []
    stage.begun()
    k0, values = read_preview(stage.chunks[0], stage.node.grid, "yaw_rate")
    expected = build_reference(stage.node.scenario).preview(0, PREVIEW + 2 * CHUNK + 1)
    assert (k0, values.tobytes()) == (0, expected.tobytes())


def test_a_plant_that_makes_no_claim_is_served_as_well(stage: Stage) -> None:
    stage.plant.sends(topics.CLOCK)
    stage.ros.spin_until(lambda: stage.chunks)
    assert stage.first_steps() == [0]


def newcomer(stage: Stage) -> Any:
    """The clock of a flight that the node comes into; it hears it twice, by a second listener with best effort."""
    clock = stage.plant.sends(topics.CLOCK)
    stage.claim(serving=True)
    stage.ros.spin_until(lambda: clock.get_subscription_count() == 2)
    return clock


def test_a_newcomer_to_a_flight_begins_with_the_chunk_of_the_clock_s_step(stage: Stage) -> None:
    newcomer(stage)
    stage.ros.spin_for(0.3)
    assert stage.chunks == []
    stage.turn_to(57, 58)
    stage.ros.spin_until(lambda: stage.chunks)
    stage.ros.spin_for(0.1)
    assert stage.first_steps() == [50]


def test_a_newcomer_sends_nothing_older_when_the_clock_s_backlog_arrives(stage: Stage) -> None:
    """Its reliable listener has the whole backlog late: each setpoint is sent, no chunk is replaced."""
    clock = newcomer(stage)
    for k in (57, 71):
        stage.node.on_newest_clock(stage.write(k))
    stage.turn_to(*range(33, 82))
    stage.ros.spin_until(lambda: clock.get_subscription_count() == 1)  # costs nothing from then on
    stage.ros.spin_until(lambda: len(stage.chunks) == 3)
    assert stage.first_steps() == [50, 70, 80]


def test_a_new_flight_s_clock_counts_after_a_backlog(stage: Stage) -> None:
    newcomer(stage)
    stage.node.on_newest_clock(stage.write(57))
    stage.turn_to(57, 0, 1)
    stage.ros.spin_until(lambda: len(stage.chunks) == 2)
    assert stage.first_steps() == [50, 0]


def test_a_late_listener_hears_only_the_last_claim_of_a_node(ros: Ros) -> None:
    stage = Stage(ros).begun()
    stage.turn_to(0)
    late = ros.partner("late").hear(topics.ROLL_CALL)
    ros.spin_until(lambda: [c for c in late if json.loads(c.data)["kind"] == "reference"])
    ros.spin_for(0.2)
    own = [claim for m in late if (claim := json.loads(m.data))["kind"] == "reference"]
    assert [claim["serving"] for claim in own] == [True]


def test_each_step_has_its_setpoint_and_a_preview_that_covers_it(stage: Stage) -> None:
    stage.begun()
    stage.turn_to(*range(35))
    stage.ros.spin_until(lambda: len(stage.chunks) == 4)
    assert stage.first_steps() == [0, 10, 20, 30]
    reference = build_reference(stage.node.scenario)
    for k, setpoint in enumerate(stage.setpoints):
        assert stage.node.grid.step_of(setpoint.header.stamp) == k
        assert setpoint.twist.angular.z == reference.value(k)
        k0, values = read_preview(stage.chunks[k // CHUNK], stage.node.grid, "yaw_rate")
        assert values[k - k0 :].size > PREVIEW
        assert values[k - k0] == reference.value(k)


def test_a_late_listener_gets_the_newest_chunk(stage: Stage) -> None:
    stage.begun()
    stage.turn_to(0, 12, 25)
    late = stage.ros.partner("late").hear(topics.REFERENCE_PREVIEW)
    stage.ros.spin_until(lambda: late and read_preview(late[-1], stage.node.grid, "yaw_rate")[0] == 20)


def test_a_clock_that_jumps_finds_its_chunk(stage: Stage) -> None:
    stage.begun()
    stage.turn_to(0, 95, 3)
    stage.ros.spin_until(lambda: len(stage.chunks) == 3)
    assert stage.first_steps() == [0, 90, 0]


def test_a_repeated_clock_repeats_its_chunk(stage: Stage) -> None:
    """The plant sends its clock again when it waits, which may be for want of this chunk."""
    stage.begun()
    stage.turn_to(12, 13, 13, 14)
    stage.ros.spin_until(lambda: len(stage.chunks) == 3)
    stage.ros.spin_for(0.1)
    assert stage.first_steps() == [0, 10, 10]


def test_it_is_silent_where_the_clock_goes_on_for_another_skydiver(stage: Stage) -> None:
    stage.begun()
    last = stage.node.scenario.steps
    stage.plant.sends(topics.CLOCK).publish(stage.write(last + 1))
    stage.turn_to(last)
    stage.ros.spin_until(lambda: len(stage.chunks) == 2)
    assert [stage.node.grid.step_of(setpoint.header.stamp) for setpoint in stage.setpoints] == [last]
    assert stage.first_steps() == [0, last // CHUNK * CHUNK]


@pytest.mark.parametrize("edit", ["off the grid", "not set"])
def test_a_clock_that_cannot_be_used_is_counted(stage: Stage, edit: str) -> None:
    stage.begun()
    bad: Any = Clock()
    if edit == "off the grid":
        stage.node.grid.set_stamp(bad.clock, 3)
        bad.clock.nanosec += 1
    stage.plant.sends(topics.CLOCK).publish(bad)
    stage.turn_to(1)
    assert stage.node.refusals.counts == {"stamp": 1}
    assert len(stage.setpoints) == 1


def test_it_waits_for_an_awaited_recorder(ros: Ros) -> None:
    stage = Stage(ros, wait_for_recorder=True)
    stage.plant.sends(topics.CLOCK)
    stage.begun()  # the partner hears both topics, as a recorder does


@pytest.mark.parametrize(
    "given", [{}, {"dt_s": 0.002}, {"controller.k_hyst_s": 3.0}, {"controller.tau_s": 2.0}], ids=str
)
def test_the_preview_is_enough_for_the_scenario_s_controller(ros: Ros, given: dict[str, float]) -> None:
    stage = Stage(ros, **given)
    stage.plant.sends(topics.CLOCK)
    stage.begun()
    needed = build_controller(stage.node.scenario).preview_steps + 1
    assert len(stage.chunks[0].points) >= needed + CHUNK
