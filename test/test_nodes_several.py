"""Several skydivers under one clock: one plant publishes it, the others follow."""

import json
import signal
from pathlib import Path
from typing import Any

import pytest
from ros_fixtures import NodeProcess, Partner, Processes, Ros, overrides
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from test_nodes_flight import Bag, assert_equals_simulation
from test_nodes_lifecycle import ACTIVATE, CLEANUP, CONFIGURE, DEACTIVATE, Manager

from skydiver_utc.analysis.controller_check import check
from skydiver_utc.analysis.recorded_flight import RecordedFlight
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.bag_player import PlayerNode
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.messages import ClockWriter
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.nodes.roll_call import Claim
from skydiver_utc.nodes.shared_clock import Awaited, ClockSource, read, write
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.outcome import Outcome, dorsal_axis_height

pytest_plugins = ("ros_fixtures",)

LEADER, FOLLOWER = "/skydiver", "/other"
DIVERS = {LEADER: ("fast_turn_unknown_dynamics", 0.5), FOLLOWER: ("turn_360_left", 1.0)}


def start(
    processes: Processes, namespace: str, given: dict[str, object], mode: str = "lockstep", **plant: object
) -> dict[str, NodeProcess]:
    """Controller, reference and plant of one skydiver."""
    own = {
        "controller": {"mode": mode},
        "reference": {},
        "plant": {"mode": mode, "clock_patience_s": 3.0, **plant},
    }
    return {
        kind: processes.start(kind, given | parameters, namespace=namespace)
        for kind, parameters in own.items()
    }


def flown(processes: Processes, folder: Path, mode: str) -> dict[str, Bag]:
    """Two skydivers of different scenarios and lengths, the shorter one's clock; their bags."""
    waited_for = []
    for namespace, (scenario, duration_s) in DIVERS.items():
        given = overrides(duration_s, scenario=scenario)
        bag = {"bag_folder": folder / namespace[1:]}
        waited_for.append(processes.start("recorder", given | bag, namespace=namespace))
        plant: dict[str, object] = {"followers": 1} if namespace == LEADER else {"clock": "follow"}
        nodes = start(processes, namespace, given | {"wait_for_recorder": True}, mode, **plant)
        waited_for.append(nodes["plant"])
    for node in waited_for:
        assert node.wait() == 0 or mode == "real_time", node.output
    return {namespace: Bag(folder / namespace[1:], namespace) for namespace in DIVERS}


def test_each_of_two_skydivers_flies_as_in_its_simulation(
    ros: Ros, processes: Processes, tmp_path: Path
) -> None:
    """The clock goes on for the longer flight; each recording is a run of its own."""
    for namespace, bag in flown(processes, tmp_path, "lockstep").items():
        scenario, duration_s = DIVERS[namespace]
        assert_equals_simulation(bag, load_scenario(scenario, {"duration_s": duration_s}))
        recording = RecordedFlight(tmp_path / namespace[1:])
        found = check(recording)
        assert found.equal
        assert len(found.commands) == bag.scenario.steps
        player = PlayerNode(ros.context, {"run": str(tmp_path / namespace[1:]), "topics": ["state"]})
        assert {item.topic for item in player.items} == {"/clock", f"{namespace}/state"}
        player.destroy_node()
        assert bag.steps(topics.CLOCK)[: bag.scenario.steps + 1] == list(range(bag.scenario.steps + 1))


def test_two_skydivers_in_real_time(processes: Processes, tmp_path: Path) -> None:
    """Whatever a machine that is held up does to the commands: no step is missing, and both stay belly to earth."""
    for bag in flown(processes, tmp_path, "real_time").values():
        outcome = bag.outcome()
        account = outcome["real_time"]
        assert outcome["outcome"] in ("completed", "no_command")
        assert account["steps"] == bag.scenario.steps
        held = [account[kind] for kind in ("on_time", "late", "stale", "lost")]
        assert sum(held) == bag.scenario.steps
        assert bag.steps(topics.STATE) == list(range(bag.scenario.steps + 1))
        assert (dorsal_axis_height(bag.states()) > 0.0).all()


def test_a_follower_whose_leader_is_killed_says_so(processes: Processes) -> None:
    given = overrides(600.0)
    leader = start(processes, LEADER, given, followers=1)
    follower = start(processes, FOLLOWER, given, clock="follow", progress=True)
    follower["plant"].wait_for_output('"step": 238')
    leader["plant"].kill()
    assert follower["plant"].wait() == 1
    assert "no_clock: the clock of /skydiver stands still at step" in follower["plant"].output


def test_a_leader_goes_on_without_a_follower_that_was_killed(processes: Processes) -> None:
    follower = start(processes, FOLLOWER, overrides(600.0), clock="follow", progress=True)
    leader = start(processes, LEADER, overrides(2.0), followers=1)
    follower["plant"].wait_for_output('"step": 119')
    follower["plant"].kill()
    assert leader["plant"].wait() == 0, leader["plant"].output
    assert "the plant of /other has said nothing for" in leader["plant"].output
    assert "completed" in leader["plant"].output


def test_a_leader_that_is_stopped_tells_its_followers(processes: Processes) -> None:
    given = overrides(600.0)
    leader = start(processes, LEADER, given, followers=1)
    follower = start(processes, FOLLOWER, given, clock="follow", progress=True)
    follower["plant"].wait_for_output('"step": 119')
    leader["plant"].signal(signal.SIGINT)
    assert leader["plant"].wait() == 0, leader["plant"].output
    assert follower["plant"].wait() == 1
    assert "no_clock: the plant of /skydiver, whose clock it follows, has ended" in follower["plant"].output


def test_a_second_plant_with_a_clock_of_its_own_leaves(processes: Processes) -> None:
    first = start(processes, LEADER, overrides(600.0), progress=True)
    first["plant"].wait_for_output('"step": 119')
    second = processes.start("plant", overrides(), namespace=FOLLOWER)
    assert second.wait() == 2
    assert "the plant of /skydiver (process" in second.output
    assert "let this one follow it by -p clock:=follow" in second.output
    assert not first["plant"].ended


def test_a_newcomer_in_another_mode_leaves_and_the_two_fly_on(processes: Processes) -> None:
    leader = start(processes, LEADER, overrides(8.0), followers=1)
    follower = start(processes, FOLLOWER, overrides(8.0), clock="follow", progress=True)
    follower["plant"].wait_for_output('"step": 119')
    newcomer = processes.start("plant", overrides(mode="real_time"), namespace="/third")
    assert newcomer.wait() == 2
    for plant in (leader["plant"], follower["plant"]):
        assert plant.wait() == 0, plant.output
        assert "completed" in plant.output


@pytest.mark.parametrize("again", [LEADER, FOLLOWER], ids=["leader", "follower"])
def test_either_plant_may_be_interrupted_and_started_again_before_the_flight(
    processes: Processes, again: str
) -> None:
    given = overrides(2.0)
    waits: dict[str, dict[str, object]] = {
        LEADER: given | {"followers": 1},
        FOLLOWER: given | {"clock": "follow"},
    }
    plants = {name: processes.start("plant", waits[name], namespace=name) for name in waits}
    for name in waits:
        processes.start("reference", given, namespace=name)
    processes.start("controller", given, namespace=FOLLOWER)
    plants[LEADER].wait_for_output("the plant of /other follows this clock")
    plants[again].signal(signal.SIGINT)
    assert plants[again].wait() == 0, plants[again].output
    plants[again] = processes.start("plant", waits[again], namespace=again)
    plants[again].wait_for_output("steps of")
    processes.start("controller", given, namespace=LEADER)
    for plant in plants.values():
        assert plant.wait() == 0, plant.output
        assert "completed" in plant.output


def test_two_plants_that_are_managed_fly_again_after_a_clean_up(ros: Ros, processes: Processes) -> None:
    """The leader is cleaned up in flight: its follower ends at once, and both fly a whole second flight."""
    given = overrides(12.0)
    roles: dict[str, dict[str, object]] = {LEADER: {"followers": 1}, FOLLOWER: {"clock": "follow"}}
    plants = {
        name: start(processes, name, given, progress=True, autostart=False, **role)["plant"]
        for name, role in roles.items()
    }
    managers = {name: Manager(ros, "plant", name) for name in plants}
    for number in (CONFIGURE, ACTIVATE):
        assert all(manager.transition(number) for manager in managers.values())
    plants[FOLLOWER].wait_for_output('"step": 119')
    assert managers[LEADER].transition(DEACTIVATE)
    assert managers[LEADER].transition(CLEANUP)
    plants[FOLLOWER].wait_for_output("no_clock: the plant of /skydiver, whose clock it follows, has ended")
    assert managers[FOLLOWER].transition(DEACTIVATE)
    assert managers[FOLLOWER].transition(CLEANUP)
    for number in (CONFIGURE, ACTIVATE):
        assert all(manager.transition(number) for manager in managers.values())
    for plant in plants.values():
        plant.wait_for_output('"outcome": "completed"')


class Led:
    """A follower with controller and reference in this process; a partner plays the leader."""

    def __init__(self, ros: Ros, **parameters: object) -> None:
        self.ros = ros
        mode = parameters.get("mode", "lockstep")
        given = overrides(clock="follow", clock_patience_s=2.0, **parameters)
        self.plant: PlantNode = ros.add(PlantNode(ros.context, given))
        ros.add(ReferenceNode(ros.context, overrides()))
        ros.add(ControllerNode(ros.context, overrides(mode=mode)))
        self.leader: Partner = ros.partner("leader")
        self.heard = self.leader.hear(topics.CLOCK_AWAITED)
        self.clocks = self.leader.sends(topics.CLOCK)
        self.source = ClockSource(
            Claim("plant", "a", 1, True, 1, "there"),
            LEADER,
            "lockstep",
            self.plant.grid.dt_ns,
            self.plant.grid.epoch_ns,
        )

    def tell(self, **changes: Any) -> None:
        fields = {name: getattr(self.source, name) for name in self.source.__struct_fields__}
        self.leader.sends(topics.CLOCK_SOURCE).publish(String(data=write(ClockSource(**(fields | changes)))))

    def awaited(self) -> int:
        return read(self.heard[-1].data, Awaited).step if self.heard else -1

    def show(self, k: int) -> None:
        self.clocks.publish(ClockWriter(self.plant.grid).fill(k))

    def until_it_awaits(self, k: int) -> None:
        self.ros.spin_until(lambda: self.awaited() >= k)

    def fly_to(self, k: int) -> None:
        """Show every step up to k as soon as it is waited for."""
        for step in range(max(0, self.plant.k + 1), k + 1):
            self.until_it_awaits(step)
            self.show(step)
            self.ros.spin_until(lambda step=step: self.plant.k == step)  # type: ignore[misc]


def test_no_step_is_taken_before_the_clock_shows_it(ros: Ros) -> None:
    stage = Led(ros)
    stage.tell()
    for k in range(5):
        stage.until_it_awaits(k)
        ros.spin_for(0.1)
        assert (stage.plant.k, stage.awaited()) == (k - 1, k)
        stage.show(k)
    stage.until_it_awaits(5)
    assert stage.plant.k == 4


def test_a_clock_that_goes_back_or_comes_too_early_ends_the_flight(ros: Ros) -> None:
    stage = Led(ros)
    stage.tell()
    for k in range(3):
        stage.until_it_awaits(k)
        stage.show(k)
    stage.until_it_awaits(3)
    stage.show(0)
    ros.spin_until(lambda: stage.plant.finished)
    assert stage.plant.outcome is Outcome.NO_CLOCK
    assert "went back from step 2 to step 0" in stage.plant.reason
    ros.spin_until(lambda: read(stage.heard[-1].data, Awaited).ended)


def test_a_newcomer_with_a_clock_of_its_own_ends_no_flight_of_others(ros: Ros) -> None:
    """Neither its word, though it has another mode, nor its last one; that of the followed plant does."""
    stage = Led(ros)
    stage.tell()
    stage.fly_to(3)
    newcomer = {"claim": Claim("plant", "c", 2, False, 2, "there"), "namespace": "/c", "mode": "real_time"}
    stage.tell(**newcomer)
    ros.spin_until(lambda: stage.plant.refusals.counts["source"] == 1)
    assert "/c has a clock, too; it is /skydiver that is followed" in stage.plant.refusals.last
    stage.tell(**newcomer, ended=True)
    ros.spin_for(0.2)
    stage.fly_to(6)
    assert (stage.plant.done, stage.plant.health().values["follows"]) == (False, LEADER)
    stage.tell(ended=True)
    ros.spin_until(lambda: stage.plant.finished)
    assert stage.plant.reason == "the plant of /skydiver, whose clock it follows, has ended"


def test_a_leader_may_be_started_again_before_the_flight(ros: Ros) -> None:
    stage = Led(ros)
    stage.tell()
    stage.until_it_awaits(0)
    stage.tell(ended=True)
    ros.spin_until(lambda: "no plant that publishes /clock" in stage.plant.health().sentence)
    stage.tell(claim=Claim("plant", "b", 2, False, 2, "there"))
    stage.fly_to(5)
    assert not stage.plant.done


@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
def test_a_leader_that_was_killed_before_the_flight_has_a_successor(ros: Ros, mode: str) -> None:
    """It said no last word; its successor is looked at as any other plant."""
    stage = Led(ros)
    stage.tell()
    stage.until_it_awaits(0)
    stage.tell(claim=Claim("plant", "b", 2, False, 2, "there"), mode=mode)
    if mode == "real_time":
        ros.spin_until(lambda: stage.plant.finished)
        assert "mode is lockstep, there it is real_time" in stage.plant.refused
    else:
        ros.spin_until(lambda: stage.plant._time._source.claim.id == "b")
        stage.fly_to(2)


def test_a_clock_that_was_shown_to_an_unconfigured_plant_begins_no_flight(ros: Ros) -> None:
    stage = Led(ros, autostart=False)
    stage.tell()
    shown: list[Any] = ros.partner("witness").hear(topics.CLOCK)
    ros.spin_until(lambda: stage.clocks.get_subscription_count() >= 3)
    for k in range(4):
        stage.show(k)
    ros.spin_until(lambda: len(shown) == 4)
    manager = Manager(ros, "plant")
    assert manager.transition(CONFIGURE)
    assert manager.transition(ACTIVATE)
    stage.until_it_awaits(0)
    ros.spin_for(0.3)
    assert (stage.plant.k, stage.plant.done) == (-1, False)
    stage.fly_to(3)
    assert not stage.plant.done


def test_a_clock_that_does_not_wait_ends_the_flight(ros: Ros) -> None:
    stage = Led(ros)
    stage.tell()
    stage.fly_to(2)
    stage.until_it_awaits(3)
    stage.show(5)
    ros.spin_until(lambda: stage.plant.finished)
    assert stage.plant.outcome is Outcome.NO_CLOCK
    assert stage.plant.reason == "the clock went on without this plant, which waits for step 3, to step 5"


def test_a_clock_that_stands_still_ends_the_flight(ros: Ros) -> None:
    stage = Led(ros)
    stage.tell()
    stage.until_it_awaits(0)
    stage.show(0)
    ros.spin_until(lambda: stage.plant.finished)
    assert stage.plant.outcome is Outcome.NO_CLOCK
    assert "the clock of /skydiver stands still at step 0" in stage.plant.reason


def test_who_comes_into_a_flight_is_told_so(ros: Ros) -> None:
    stage = Led(ros)
    stage.tell()
    stage.until_it_awaits(0)
    stage.show(7)
    ros.spin_until(lambda: stage.plant.done)
    assert stage.plant.outcome is Outcome.NO_CLOCK
    assert "the clock shows step 7 already" in stage.plant.reason


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"dt_ns": 5_000_000}, "dt_s is 0.0042, there it is 0.005"),
        ({"epoch_ns": 0}, "epoch_s"),
        ({"mode": "real_time"}, "mode is lockstep, there it is real_time"),
    ],
    ids=["dt", "epoch", "mode"],
)
def test_a_clock_of_other_steps_is_not_followed(ros: Ros, change: dict[str, Any], word: str) -> None:
    stage = Led(ros)
    stage.tell(**change)
    ros.spin_until(lambda: stage.plant.finished)
    assert "it cannot follow the clock of the plant of /skydiver" in stage.plant.refused
    assert word in stage.plant.refused


def led_by(ros: Ros, **parameters: object) -> PlantNode:
    """A plant with its own clock, controller and reference in this process."""
    given = overrides(clock_patience_s=2.0, **parameters)
    plant: PlantNode = ros.add(PlantNode(ros.context, given))
    ros.add(ReferenceNode(ros.context, overrides()))
    ros.add(ControllerNode(ros.context, overrides()))
    return plant


def follower_of(ros: Ros) -> Partner:
    """Hears the clock as the plant and the reference of a second skydiver do."""
    follower = ros.partner("follower")
    for _ in ("plant", "reference"):
        follower.hear(topics.CLOCK)
    return follower


def test_the_clock_does_not_run_away_from_who_follows(ros: Ros) -> None:
    plant = led_by(ros, followers=1)
    awaits = follower_of(ros).sends(topics.CLOCK_AWAITED)
    ros.spin_for(0.5)
    assert (plant.k, "0 of 1 plants that follow the clock" in plant.health().sentence) == (-1, True)
    for k in range(4):
        awaits.publish(String(data=write(Awaited(FOLLOWER, k))))
        ros.spin_until(lambda k=k: plant.k == k)  # type: ignore[misc]
        ros.spin_for(0.05)
        assert plant.k == k
    awaits.publish(String(data=write(Awaited(FOLLOWER, 3, ended=True))))
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.COMPLETED, plant.scenario.steps)


def test_a_follower_may_be_started_again_before_the_flight(ros: Ros) -> None:
    """One that has ended is not waited for, nor counted; one that is there again is."""
    plant = led_by(ros, followers=2)
    first, second = (follower_of(ros).sends(topics.CLOCK_AWAITED) for _ in range(2))
    first.publish(String(data=write(Awaited("/first", 0))))
    ros.spin_until(lambda: "1 of 2 plants" in plant.health().sentence)
    first.publish(String(data=write(Awaited("/first", 0, ended=True))))
    ros.spin_until(lambda: "0 of 2 plants" in plant.health().sentence)
    for k in range(3):
        first.publish(String(data=write(Awaited("/first", k))))
        second.publish(String(data=write(Awaited("/second", k + 5))))
        ros.spin_until(lambda k=k: plant.k == k)  # type: ignore[misc]
        ros.spin_for(0.05)
        assert plant.k == k


def test_a_follower_that_says_nothing_before_the_flight_is_not_counted(ros: Ros) -> None:
    plant = led_by(ros, followers=2)
    follower_of(ros).sends(topics.CLOCK_AWAITED).publish(String(data=write(Awaited(FOLLOWER, 0))))
    ros.spin_until(lambda: "1 of 2 plants" in plant.health().sentence)
    ros.spin_until(lambda: "0 of 2 plants" in plant.health().sentence)
    assert plant.k == -1


def test_a_leader_that_is_cleaned_up_in_flight_says_so_and_leads_again(ros: Ros) -> None:
    """What the follower of the first flight says last does not count in the second one."""
    plant = led_by(ros, followers=1)
    follower = follower_of(ros)
    awaits = follower.sends(topics.CLOCK_AWAITED)
    told = follower.hear(topics.CLOCK_SOURCE)
    for k in range(3):
        awaits.publish(String(data=write(Awaited(FOLLOWER, k))))
        ros.spin_until(lambda k=k: plant.k == k)  # type: ignore[misc]
    manager = Manager(ros, "plant")
    assert manager.transition(DEACTIVATE)
    assert manager.transition(CLEANUP)
    ros.spin_until(lambda: [read(one.data, ClockSource).ended for one in told[-2:]] == [True, False])
    assert plant.reason == "cleaned up at step 2"
    awaits.publish(String(data=write(Awaited(FOLLOWER, 3))))
    awaits.publish(String(data=write(Awaited(FOLLOWER, 3, ended=True))))
    assert manager.transition(CONFIGURE)
    assert manager.transition(ACTIVATE)
    ros.spin_until(lambda: "0 of 1 plants" in plant.health().sentence)
    for k in range(4):
        awaits.publish(String(data=write(Awaited(FOLLOWER, k))))
        ros.spin_until(lambda k=k: plant.k == k)  # type: ignore[misc]
        ros.spin_for(0.05)
        assert plant.k == k


def test_a_leader_that_waited_in_vain_leads_after_a_clean_up(ros: Ros) -> None:
    """After its time-out a follower's word moves no clock; after the clean-up its latched word is true again."""
    plant = led_by(ros, followers=1, startup_timeout_s=1.0)
    follower = follower_of(ros)
    awaits, told = follower.sends(topics.CLOCK_AWAITED), follower.hear(topics.CLOCK_SOURCE)
    clocks = follower.heard[topics.CLOCK]
    ros.spin_until(lambda: plant.done and told and read(told[-1].data, ClockSource).ended)
    assert plant.outcome is Outcome.NO_COMMAND
    for k in range(2):
        awaits.publish(String(data=write(Awaited(FOLLOWER, k))))
    ros.spin_for(1.0)
    assert (clocks, read(told[-1].data, ClockSource).ended) == ([], True)
    manager = Manager(ros, "plant")
    for number in (DEACTIVATE, CLEANUP):
        assert manager.transition(number)
    ros.spin_until(lambda: not read(told[-1].data, ClockSource).ended)
    awaits.publish(String(data=write(Awaited(FOLLOWER, 0))))
    for number in (CONFIGURE, ACTIVATE):
        assert manager.transition(number)
    ros.spin_until(lambda: plant.k == 0)


def test_a_flight_that_meets_a_senior_clock_ends_with_an_outcome(ros: Ros) -> None:
    plant = led_by(ros, followers=1)
    follower = follower_of(ros)
    told, outcomes = follower.hear(topics.CLOCK_SOURCE), follower.hear(topics.OUTCOME)
    follower.sends(topics.CLOCK_AWAITED).publish(String(data=write(Awaited(FOLLOWER, 2))))
    ros.spin_until(lambda: plant.k == 2)
    senior = ClockSource(Claim("plant", "z", 1, True, 1, "there"), "/z", "lockstep", 1, 0)
    follower.sends(topics.CLOCK_SOURCE).publish(String(data=write(senior)))
    ros.spin_until(lambda: plant.refusals.counts["source"] == 1)
    assert not plant.finished  # it may be a stranger's word: no plant of /z is in the graph
    alive = topics.ALIVE[topics.PLANT]
    follower.create_publisher(alive.type, f"/z/{alive.name}", alive.qos)
    ros.spin_until(lambda: plant.finished and outcomes and read(told[-1].data, ClockSource).ended)
    outcome = json.loads(outcomes[-1].data)
    assert outcome["outcome"] == "aborted"
    assert outcome["reason"] == plant.refused
    assert "the plant of /z (process 1 on there) publishes /clock already" in plant.refused


def test_each_of_several_followers_is_heard(ros: Ros) -> None:
    """Both speak before the leader listens: neither word replaces the other."""
    plant = led_by(ros, followers=2)
    both = [(f"/other_{i}", follower_of(ros).sends(topics.CLOCK_AWAITED)) for i in range(2)]
    for k in range(4):
        for namespace, awaits in both:
            awaits.publish(String(data=write(Awaited(namespace, k))))
        ros.spin_until(lambda k=k: plant.k == k)  # type: ignore[misc]
    assert plant.health().values["followers"] == "/other_0 flying, /other_1 flying"


def test_the_clock_goes_on_without_a_follower_that_says_nothing(ros: Ros) -> None:
    plant = led_by(ros, followers=1)
    follower_of(ros).sends(topics.CLOCK_AWAITED).publish(String(data=write(Awaited(FOLLOWER, 1))))
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.COMPLETED, plant.scenario.steps)


def test_another_publisher_of_the_clock_is_an_error_in_the_diagnostics(ros: Ros) -> None:
    plant = led_by(ros, followers=1)
    player = ros.partner("player")
    player.create_publisher(Clock, "/clock", topics.EACH_STEP)
    ros.spin_until(lambda: "2 publishers of /clock" in plant.health().sentence)
    health = plant.health()
    assert (health.level.name, health.values["publishers_of_clock"]) == ("ERROR", 2)
    assert "/skydiver/plant, /skydiver/player" in health.sentence


@pytest.mark.parametrize("kind", [ClockSource, Awaited])
@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "{}",
        '{"namespace": 1, "step": 2}',
        '{"namespace": "/a", "step": 1e9}',
        "[" * 100_000,
    ],
    ids=lambda text: text[:20],
)
def test_what_plants_under_one_clock_do_not_say_is_refused(kind: Any, text: str) -> None:
    with pytest.raises(BorderError):
        read(text, kind)


def test_nonsense_on_the_topics_of_the_clock_is_counted(ros: Ros) -> None:
    plant = led_by(ros, followers=1)
    partner = ros.partner()
    for topic in (topics.CLOCK_SOURCE, topics.CLOCK_AWAITED):
        partner.sends(topic).publish(String(data=json.dumps({"step": "x"})))
    ros.spin_until(lambda: plant.refusals.counts["clock"] == 2)
