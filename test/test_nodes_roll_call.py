"""One node of a kind: the newcomer leaves, the flight goes on."""

import json
from typing import Any

import pytest
from ros_fixtures import Partner, Processes, Ros, overrides
from std_msgs.msg import String

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.messages import StateWriter
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.nodes.roll_call import Claim, RollCall, read_claim
from skydiver_utc.nodes.seniors_word import SeniorsWord
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.build import build_plant
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.outcome import Outcome

pytest_plugins = ("ros_fixtures",)

ELDER = Claim("plant", "a", 10, False, 1, "here")


@pytest.mark.parametrize(
    ("senior", "junior"),
    [
        (ELDER, ELDER._replace(id="b", since_ns=11)),
        (ELDER._replace(since_ns=12, serving=True), ELDER._replace(id="b")),
        (ELDER._replace(serving=True), ELDER._replace(id="b", since_ns=11, serving=True)),
        (ELDER, ELDER._replace(id="b")),
    ],
    ids=["started first", "serves a flight", "both serve", "at once"],
)
def test_exactly_one_of_two_stays(senior: Claim, junior: Claim) -> None:
    assert senior.senior_to(junior)
    assert not junior.senior_to(senior)


def told_to(claim: Claim, **own: Any) -> list[str]:
    """Why a node beside which there is another one leaves when it hears this claim."""
    sentences: list[str] = []
    roll_call = RollCall("plant", lambda _: None, lambda: True, sentences.append)
    roll_call.claim = roll_call.claim._replace(**own)
    roll_call.hear(claim)
    return sentences


def test_a_node_leaves_only_for_a_senior_of_its_own_kind() -> None:
    (sentence,) = told_to(ELDER)
    assert "another plant is here already (process 1 on here" in sentence
    assert told_to(ELDER._replace(kind="controller")) == []
    assert told_to(ELDER, id="a") == []
    assert told_to(ELDER, serving=True) == []


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "null", "{}", '{"kind": "plant"}', "[" * 100_000]
    + [
        json.dumps(ELDER._asdict() | change)
        for change in ({"since_ns": 1e9}, {"since_ns": -1}, {"since_ns": 2**70}, {"serving": 1}, {"x": 2})
    ],
    ids=lambda text: text[:20],
)
def test_what_is_no_claim_is_refused(text: str) -> None:
    with pytest.raises(BorderError):
        read_claim(text)


def test_what_is_sent_can_be_read() -> None:
    sent: list[Any] = []
    roll_call = RollCall("plant", sent.append, lambda: False, lambda _: None)
    roll_call.serve()
    roll_call.serve()
    first, second = (read_claim(message.data) for message in sent)
    assert (first.serving, second.serving) == (False, True)
    assert second == roll_call.claim


@pytest.mark.parametrize("kind", [PlantNode, ControllerNode, ReferenceNode])
def test_the_second_of_a_kind_leaves_and_the_first_flies_on(ros: Ros, kind: Any) -> None:
    nodes = {k: ros.add(k(ros.context, overrides(1.0))) for k in (PlantNode, ControllerNode, ReferenceNode)}
    plant = nodes[PlantNode]
    ros.spin_until(lambda: plant.k > 3)
    outcomes = ros.partner("listener").hear(topics.OUTCOME)
    newcomer = ros.add(kind(ros.context, overrides(1.0)))
    ros.spin_until(lambda: newcomer.finished)
    assert f"another {newcomer.get_name()} is here already" in newcomer.refused
    newcomer.close()
    ros.remove(newcomer)
    ros.spin_until(lambda: plant.finished and outcomes)
    assert plant.outcome is Outcome.COMPLETED
    assert len(outcomes) == 1
    assert nodes[kind].refused == ""
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 1.0}))
    assert plant._state.tobytes() == flight.states[-1].tobytes()


def test_a_node_that_has_gone_is_not_in_the_way(ros: Ros) -> None:
    first = ros.add(ControllerNode(ros.context, overrides()))
    ros.spin_for(0.1)
    ros.remove(first)
    second = ros.add(ControllerNode(ros.context, overrides()))
    ros.spin_for(0.5)
    assert not second.finished


SERVING_ELDER = Claim("plant", "x", 1, True, 1, "h")


def flying(ros: Ros, duration_s: float = 600.0) -> PlantNode:
    """A plant in flight, with controller and reference."""
    plant: PlantNode = ros.add(PlantNode(ros.context, overrides(duration_s)))
    for kind in (ControllerNode, ReferenceNode):
        ros.add(kind(ros.context, overrides(duration_s)))
    ros.spin_until(lambda: plant.k > 3)
    return plant


def claims(partner: Partner, claim: Claim) -> None:
    partner.sends(topics.ROLL_CALL).publish(String(data=json.dumps(claim._asdict())))


@pytest.mark.parametrize("kind", ["plant", "controller", "reference"])
def test_a_whole_claim_of_a_node_that_is_not_there_stops_no_flight(ros: Ros, kind: str) -> None:
    plant = flying(ros, duration_s=6.0)
    nodes = {node.get_name(): node for node in ros.executor.get_nodes()}
    claims(ros.partner("stranger"), SERVING_ELDER._replace(kind=kind))
    ros.spin_until(lambda: nodes[kind].refusals.counts["claim"] == 1)
    assert f"another {kind} is here already" in nodes[kind].refusals.last
    assert nodes[kind].refusals.last.endswith("00:00:00 UTC), which the graph does not confirm")
    ros.spin_until(lambda: plant.finished)
    assert plant.outcome is Outcome.COMPLETED
    assert not any(nodes[name].refused for name in (kind, "plant"))


@pytest.mark.parametrize("first", ["the graph", "the claim"])
def test_a_plant_that_meets_a_senior_one_in_flight_ends_with_an_outcome(ros: Ros, first: str) -> None:
    """As when two networks are joined; the graph may know of the other one a moment later than its claim comes."""
    plant = flying(ros)
    other = ros.partner("other")
    outcomes = other.hear(topics.OUTCOME)
    if first == "the graph":
        other.sends(topics.ALIVE[topics.PLANT])
        ros.spin_until(lambda: plant.count_publishers(topics.ALIVE[topics.PLANT].name) == 2)
        claims(other, SERVING_ELDER)
    else:
        claims(other, SERVING_ELDER)
        ros.spin_until(lambda: plant.refusals.counts["claim"] == 1)
        other.sends(topics.ALIVE[topics.PLANT])
    ros.spin_until(lambda: plant.finished and outcomes)
    outcome = json.loads(outcomes[-1].data)
    assert (outcome["outcome"], outcome["reason"]) == ("aborted", plant.refused)
    assert "another plant is here already (process 1 on h" in plant.refused
    assert outcome["states"] == plant.k + 1


def test_a_plant_that_flies_does_not_leave_for_one_that_comes_later(ros: Ros) -> None:
    plant = flying(ros)
    other = ros.partner("other")
    other.sends(topics.ALIVE[topics.PLANT])
    ros.spin_until(lambda: plant.count_publishers(topics.ALIVE[topics.PLANT].name) == 2)
    claims(other, SERVING_ELDER._replace(serving=False))
    assert plant._roll_call is not None
    ros.spin_until(lambda: plant._roll_call.others == 1)
    assert not plant.finished


def test_a_doubted_claim_is_forgotten_before_long(monkeypatch: pytest.MonkeyPatch) -> None:
    now, sentences, there = [0.0], [], [False]
    monkeypatch.setattr("skydiver_utc.nodes.seniors_word.time.monotonic", lambda: now[0])
    word = SeniorsWord(sentences.append)
    for later_s, leaves in ((1.5, True), (2.5, False)):
        there[0] = False
        with pytest.raises(BorderError, match="it says that the sky is full, which the graph"):
            word.heed("the sky is full", "land", lambda: there[0], "claim")
        now[0] += later_s
        word.look_again()
        there[0] = True
        word.look_again()
        word.look_again()
        assert sentences == (["the sky is full: land"] if leaves else [])
        sentences.clear()


def test_a_claim_that_cannot_be_read_is_counted(ros: Ros) -> None:
    node = ros.add(PlantNode(ros.context, overrides()))
    ros.partner().sends(topics.ROLL_CALL).publish(String(data="nonsense"))
    ros.spin_until(lambda: node.refusals.counts == {"claim": 1})


def test_a_step_0_of_a_second_plant_does_not_begin_the_flight_again(ros: Ros) -> None:
    """Before the roll call has reached it a second plant may send a state."""
    nodes = [ros.add(k(ros.context, overrides(600.0))) for k in (PlantNode, ControllerNode, ReferenceNode)]
    plant, controller = nodes[0], nodes[1]
    ros.spin_until(lambda: plant.k > 3)
    intruder = ros.partner("intruder").sends(topics.STATE)
    ros.spin_until(
        lambda: intruder.get_subscription_count() and controller._states.get_publisher_count() == 2
    )
    intruder.publish(StateWriter(plant.grid).fill(0, build_plant(plant.scenario).initial_state()))
    ros.spin_until(lambda: controller.refusals.counts["second_plant"] == 1)
    before = plant.k
    ros.spin_until(lambda: plant.k > before + 3)
    assert plant.retries == 0


def test_a_second_plant_process_says_one_sentence_and_fails(ros: Ros, processes: Processes) -> None:
    for kind in (PlantNode, ControllerNode, ReferenceNode):
        node = ros.add(kind(ros.context, overrides(600.0)))
    ros.spin_until(lambda: node.newest_step() > 3)
    second = processes.start("plant", overrides(600.0))
    ros.spin_until(lambda: second.ended)
    assert second.wait() == 2
    assert "Traceback" not in second.output
    last = second.output.strip().splitlines()[-1]
    assert last.startswith("plant_node: another plant is here already")
