"""Parameters that change in flight: checked as a whole, in force from a step on, recorded, replayed."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter
from ros_fixtures import Processes, Ros, overrides
from std_msgs.msg import String
from test_nodes_flight import Bag
from test_nodes_lifecycle import ACTIVATE, CLEANUP, CONFIGURE, DEACTIVATE, Manager, Stage

from skydiver_utc.analysis.recorded_flight import read_flight
from skydiver_utc.cli import main
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.parameters import Scenario, leaves, load_scenario, override, to_yaml
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference
from skydiver_utc.simulation.closed_loop import simulate

pytest_plugins = ("ros_fixtures",)

SCENARIO = "fast_turn_unknown_dynamics"


class Remote(Manager):
    """Sets parameters as `ros2 param` does: by the services of the node."""

    def set(self, **values: Any) -> Any:
        """All or none; a double underscore stands for a dot."""
        return self.call(
            "set_parameters_atomically", SetParametersAtomically, parameters=_messages(values)
        ).result


def _messages(values: dict[str, Any]) -> list[Any]:
    return [Parameter(n.replace("__", "."), value=v).to_parameter_msg() for n, v in values.items()]


class RecordedStage(Stage):
    """Plant, controller, reference and recorder, the flight paused soon after its beginning."""

    def __init__(
        self,
        ros: Ros,
        folder: Path,
        duration_s: float = 2.0,
        chunk_steps: int = 80,
        command_timeout_s: float = 50.0,
    ) -> None:
        super().__init__(ros, duration_s, wait_for_recorder=True)
        self.folder = folder
        self.add("controller")
        self.add("reference", chunk_steps=chunk_steps)
        plant = self.add("plant", command_timeout_s=command_timeout_s, command_retries=1000)
        self.given.pop("wait_for_recorder")
        self.recorder = self.add("recorder", bag_folder=str(folder))
        self.pause = Manager(ros, "plant")
        ros.spin_until(lambda: plant.k >= 30)
        assert self.pause.transition(DEACTIVATE)
        # Until the command for the last state is there: from then on nothing moves.
        ros.spin_until(lambda: self.nodes["controller"].answered == plant.k)
        ros.spin_for(0.2)
        self.k: int = plant.k

    def fly_on(self) -> Bag:
        assert self.pause.transition(ACTIVATE)
        self.ros.spin_until(lambda: self.recorder.finished and not self.recorder.missing())
        assert self.recorder.close() == 0
        return Bag(self.folder)

    def changes(self) -> list[dict[str, Any]]:
        return [json.loads(message.data) for message in Bag(self.folder).of(topics.CHANGES)]


def by_hand(
    scenario: Scenario, at: int, controller: dict[str, Any] | None = None, plant: dict[str, Any] | None = None
) -> Any:
    """States and commands of a flight whose controller is replaced at a step, and whose plant is: no node in it."""
    body, pilot, reference = build_plant(scenario), build_controller(scenario), build_reference(scenario)
    state, applied = body.initial_state(), body.initial_applied()
    states, commands = [state], []
    for k in range(scenario.steps):
        if k == at and controller is not None:
            pilot = build_controller(override(scenario, controller))
            pilot.resume(commands[-1])
        if k == at and plant is not None:
            body = build_plant(override(scenario, plant))
        decision = pilot.decide(state, reference.preview(k, pilot.preview_steps + 1))
        commands.append(decision.control)
        before, applied = applied, body.actuate(decision.control, applied)
        state = body.step(state, before, applied)
        states.append(state)
    return np.array(states), np.array(commands)


def check(folder: Path, *arguments: str) -> dict[str, Any]:
    result = CliRunner().invoke(main, ["replay", str(folder), "--check", "--json", *arguments])
    return dict(json.loads(result.stdout))


def record(ros: Ros, folder: Path, kind: str, given: dict[str, Any]) -> Bag:
    """A flight of 0.4 s, its controller or reference started with parameters of its own."""
    stage = Stage(ros, 0.4, wait_for_recorder=True)
    for other in ("controller", "reference"):
        stage.add(other, **(given if other == kind else {}))
    stage.add("plant", command_timeout_s=50.0)
    stage.given.pop("wait_for_recorder")
    recorder = stage.add("recorder", bag_folder=str(folder))
    ros.spin_until(lambda: recorder.finished and not recorder.missing())
    assert recorder.close() == 0
    return Bag(folder)


@pytest.mark.parametrize(
    ("kind", "given"),
    [
        ("controller", {"controller.horizon_steps": 10}),
        (
            "controller",
            {"controller.horizon_steps": 10, "controller.P_err": 4e-4, "plant.hands.K_N": 20.0},
        ),
        ("reference", {"reference.amplitude_deg_s": 30.0}),
    ],
)
def test_parameters_given_to_one_node_at_the_start_are_recorded(
    ros: Ros, tmp_path: Path, kind: str, given: dict[str, Any]
) -> None:
    bag = record(ros, tmp_path / "bag", kind, given)
    told = [json.loads(message.data) for message in bag.of(topics.CHANGES)]
    assert told == [{"node": kind, "step": 0, "parameters": given, "control": None}]
    flown = simulate(override(load_scenario(SCENARIO, {"duration_s": 0.4}), given))
    if "plant.hands.K_N" not in given:  # then only the controller's model has other hands
        assert bag.states().tobytes() == flown.states.tobytes()
    assert check(tmp_path / "bag")["equal"]


def test_a_delay_that_is_compensated_is_recorded_told_and_asked_again(ros: Ros, tmp_path: Path) -> None:
    """It is a parameter of the controller's node and of no scenario."""
    bag = record(ros, tmp_path / "bag", "controller", {"delay_steps": 2})
    told = [json.loads(message.data) for message in bag.of(topics.CHANGES)]
    assert told == [{"node": "controller", "step": 0, "parameters": {"delay_steps": 2}, "control": None}]
    plain = simulate(load_scenario(SCENARIO, {"duration_s": 0.4}))
    assert bag.controls(topics.COMMAND).tobytes() != plain.commands.tobytes()
    assert check(tmp_path / "bag")["equal"]
    result = CliRunner().invoke(main, ["analyse", str(tmp_path / "bag")])
    assert "controller from 0.000 s on" in result.output
    assert "delay_steps = 2" in result.output
    assert "delay_steps = 2" in (tmp_path / "bag" / "report.html").read_text()


@pytest.mark.parametrize("in_flight", [False, True], ids=["before the flight", "in flight"])
def test_a_scenario_of_a_stranger_is_refused_and_changes_no_record(ros: Ros, in_flight: bool) -> None:
    """A readable one; who the plant is tells the roll call."""
    stage = Stage(ros, 600.0)
    stranger = ros.partner("stranger")
    changes, sender = stranger.hear(topics.CHANGES), stranger.sends(topics.SCENARIO)
    text = to_yaml(load_scenario(SCENARIO, {"controller.P_err": 9e-4, "reference.amplitude_deg_s": 30.0}))
    listeners = [stage.add(kind) for kind in ("controller", "reference")]
    ros.spin_until(lambda: sender.get_subscription_count() == 2)
    if not in_flight:
        sender.publish(String(data=text))
        ros.spin_for(0.3)
    plant = stage.add("plant", command_timeout_s=50.0)
    ros.spin_until(lambda: plant.k > 30)
    sender.publish(String(data=text))
    ros.spin_until(lambda: all(node.refusals.counts["stranger"] == 1 for node in listeners))
    before = plant.k
    ros.spin_until(lambda: plant.k > before + 100)
    assert changes == []
    assert not any(node.differs for node in listeners)


def test_the_scenario_of_the_plant_that_comes_after_one_that_died_counts(ros: Ros) -> None:
    stage = Stage(ros, 600.0)
    changes = ros.partner("listener").hear(topics.CHANGES)
    controller = stage.add("controller")
    stage.add("reference")
    first = stage.add("plant", command_timeout_s=50.0)
    ros.spin_until(lambda: first.k > 30)
    assert changes == []
    ros.remove(first)
    second = stage.add("plant", command_timeout_s=50.0, **{"plant.limits.k_left": [-0.5, 0.5]})
    ros.spin_until(lambda: second.k > 30 and changes)
    differs = {"plant.limits.k_left": list(controller.scenario.plant.limits.k_left)}
    record = {"node": "controller", "step": 0, "parameters": differs, "control": None}
    assert all(json.loads(message.data) == record for message in changes)
    assert controller.differs == differs


def test_a_controller_that_changed_in_flight_is_checked_bit_for_bit(ros: Ros, tmp_path: Path) -> None:
    stage = RecordedStage(ros, tmp_path / "bag")
    remote = Remote(ros, "controller")
    change = {"controller.P_err": 4e-4, "controller.W0": 0.1, "controller.horizon_steps": 40}
    assert remote.set(**{name.replace(".", "__"): value for name, value in change.items()}).successful
    bag = stage.fly_on()
    at = stage.k + 1
    assert stage.changes() == [
        {
            "node": "controller",
            "step": at,
            "parameters": change,
            "control": bag.controls(topics.COMMAND)[at - 1].tolist(),
        }
    ]
    states, commands = by_hand(bag.scenario, at, controller=change)
    assert bag.states().tobytes() == states.tobytes()
    assert bag.controls(topics.COMMAND).tobytes() == commands.tobytes()
    assert states.tobytes() != simulate(bag.scenario).states.tobytes()
    values = check(stage.folder)
    assert (values["equal"], values["reference_steps_not_recorded"]) == (True, 0)
    # Asked without the longer horizon it answers otherwise, but not before the change.
    assert check(stage.folder, "--set", "controller.horizon_steps=20")["first_difference"]["step"] >= at


def test_analyse_tells_what_changed(ros: Ros, tmp_path: Path) -> None:
    stage = RecordedStage(ros, tmp_path / "bag")
    assert Remote(ros, "controller").set(controller__P_err=4e-4).successful
    stage.fly_on()
    at, dt_s = stage.k + 1, 0.0042
    result = CliRunner().invoke(main, ["analyse", str(stage.folder)])
    assert result.exit_code == 0, result.output
    assert f"controller from {at * dt_s:.3f} s on" in result.output
    assert "controller.P_err = 0.0004" in result.output
    metrics = json.loads((stage.folder / "metrics.json").read_text())
    assert metrics["parameter_changes"] == [
        {
            "node": "controller",
            "step": at,
            "time_s": pytest.approx(at * dt_s),
            "parameters": {"controller.P_err": 4e-4},
        }
    ]
    assert "controller.P_err = 0.0004" in (stage.folder / "report.html").read_text()


def test_a_plant_that_changed_in_flight_flies_as_one_replaced_by_hand(ros: Ros, tmp_path: Path) -> None:
    stage = RecordedStage(ros, tmp_path / "bag")
    change = {
        "plant.damping.Cm_damp_roll": 1.5,
        "plant.limits.k_right": [-0.5, 0.5],
        "air.density_kg_m3": 1.1,
    }
    remote = Remote(ros, "plant")
    assert remote.set(**{name.replace(".", "__"): value for name, value in change.items()}).successful
    bag = stage.fly_on()
    # The command of this step had come in the pause: the step that follows it is the first one changed.
    assert stage.changes() == [{"node": "plant", "step": stage.k, "parameters": change, "control": None}]
    states, commands = by_hand(bag.scenario, stage.k, plant=change)
    assert bag.states().tobytes() == states.tobytes()
    assert bag.controls(topics.COMMAND).tobytes() == commands.tobytes()
    assert check(stage.folder)["equal"]


def test_a_reference_changes_where_no_preview_has_told_it_yet(ros: Ros, tmp_path: Path) -> None:
    stage = RecordedStage(ros, tmp_path / "bag", chunk_steps=20)
    remote = Remote(ros, "reference")
    assert remote.set(reference__amplitude_deg_s=200.0, reference__frequency_hz=0.8).successful
    bag = stage.fly_on()
    last = stage.k // 20 * 20
    told = last + bag.scenario.preview_steps + 2 * 20 + 1
    changed = {"reference.amplitude_deg_s": 200.0, "reference.frequency_hz": 0.8}
    assert stage.changes() == [{"node": "reference", "step": told, "parameters": changed, "control": None}]
    before, after = build_reference(bag.scenario), build_reference(override(bag.scenario, changed))
    wanted = [(before if k < told else after).value(k) for k in range(bag.scenario.steps + 1)]
    assert [m.twist.angular.z for m in bag.of(topics.SETPOINT)] == wanted
    assert wanted[told] != before.value(told)
    assert read_flight(stage.folder).reference.tolist() == wanted
    assert check(stage.folder)["equal"]


def test_a_flight_whose_controller_died_and_came_back_is_checked_bit_for_bit(
    ros: Ros, tmp_path: Path
) -> None:
    """With what the new one went on from in the bag, also its answers are known."""
    stage = RecordedStage(ros, tmp_path / "bag", command_timeout_s=0.2)
    ros.remove(stage.nodes["controller"])
    stage.add("controller")
    bag = stage.fly_on()
    (told,) = stage.changes()
    assert (told["node"], told["parameters"]) == ("controller", {})
    assert told["control"] == bag.controls(topics.APPLIED_COMMAND)[told["step"] - 1].tolist()
    assert check(stage.folder)["equal"]


REFUSED = [
    ("controller", {"controller__P_err": -1.0}, "controller.P_err"),
    ("controller", {"controller__W0": 1.0}, "parameter controller.W0: expected a number < 1.0, found 1.0"),
    ("controller", {"controller__P_err": float("nan")}, "controller.P_err"),
    ("controller", {"controller__coupling": "often"}, "there is no 'often', choose one of"),
    (
        "controller",
        {"controller__horizon_steps": 20.5},
        "horizon_steps must be of type integer, found double",
    ),
    (
        "controller",
        {"controller__horizon_step": 1},
        "there is no parameter controller.horizon_step: did you mean controller.h",
    ),
    ("controller", {"plant__limits__k_right": [0.5, -0.5]}, "limits of k_right are upside down"),
    (
        "controller",
        {"plant__limits__Cm_damp_yaw": [0.6, 1.0]},
        "initial.Cm_damp_yaw must lie inside its limits",
    ),
    (
        "controller",
        {"controller__horizon_steps": 400},
        "would look 400 steps ahead, the present reference serves 239",
    ),
    (
        "controller",
        {"duration_s": 3.0},
        "duration_s is read-only: the steps of the flight are counted at the start",
    ),
    ("controller", {"reference__amplitude_deg_s": 3.0}, "is read-only: set it at the reference node"),
    ("controller", {"mode": "real_time"}, "mode is read-only: it is read at the start; start the node again"),
    (
        "controller",
        {"plant__limits__alpha": [-0.1, 0.1]},
        "plant.limits.alpha is read-only: the postures are",
    ),
    ("plant", {"controller__P_err": 1e-4}, "controller.P_err is read-only: set it at the controller node"),
    ("plant", {"subject__mass_kg": 60.0}, "subject.mass_kg is read-only: the body is built at the start"),
    ("reference", {"reference__frequency_hz": 0.0}, "reference.frequency_hz"),
    ("recorder", {"bag_folder": "elsewhere"}, "bag_folder is read-only"),
]


@pytest.fixture
def nodes(ros: Ros, tmp_path: Path) -> Stage:
    """All four nodes, each on its own: none is in a flight."""
    stage = Stage(ros, autostart=False)
    stage.add("plant", "controller", "reference")
    stage.add("recorder", bag_folder=str(tmp_path / "bag"))
    return stage


def test_what_cannot_be_set_is_refused_by_name_and_changes_nothing(ros: Ros, nodes: Stage) -> None:
    remotes = {kind: Remote(ros, kind) for kind in nodes.nodes}
    for kind, values, words in REFUSED:
        before = _values(nodes.nodes[kind])
        result = remotes[kind].set(**values)
        assert not result.successful
        assert words in result.reason
        assert "\n" not in result.reason
        assert nodes.nodes[kind].live.coming is None
        assert _values(nodes.nodes[kind]) == before


def _values(node: Any) -> dict[str, str]:
    names = node.list_parameters([], 0).names
    return {parameter.name: str(parameter.value) for parameter in node.get_parameters(names)}


def test_all_parameters_are_listed(ros: Ros, nodes: Stage) -> None:
    names = set(Remote(ros, "controller").call("list_parameters", ListParameters).result.names)
    assert names >= {leaf.name for leaf in leaves(nodes.nodes["controller"].scenario)} | {"autostart", "mode"}


def test_of_a_request_that_is_refused_in_part_nothing_is_set(ros: Ros, nodes: Stage) -> None:
    remote = Remote(ros, "controller")
    result = remote.set(controller__P_err=3e-4, controller__W0=5.0)
    assert not result.successful
    node: ControllerNode = nodes.nodes["controller"]
    assert node.get_parameter("controller.P_err").value == 1e-4
    assert node.live.coming is None
    # Two that are right only together.
    assert not remote.set(plant__limits__Cm_damp_yaw=[0.7, 0.9]).successful
    assert remote.set(controller__P_err=3e-4, controller__W0=0.5).successful
    assert node.get_parameter("controller.P_err").value == 3e-4


def test_one_by_one_each_is_checked_with_those_before(ros: Ros, nodes: Stage) -> None:
    """The service of `ros2 param set`; the third is the same value again, and no change."""
    remote = Remote(ros, "controller")
    request = _messages({"controller__P_err": 3e-4, "controller__W0": 5.0})
    results = remote.call("set_parameters", SetParameters, parameters=request).results
    assert [result.successful for result in results] == [True, False]
    request = _messages({"controller__W0": 0.5, "controller__P_err": 3e-4})
    results = remote.call("set_parameters", SetParameters, parameters=request).results
    assert [result.successful for result in results] == [True, True]
    node: ControllerNode = nodes.nodes["controller"]
    assert node.live.coming is not None
    assert node.live.coming.values == {"controller.P_err": 3e-4, "controller.W0": 0.5}


def test_a_parameter_is_described_with_what_it_may_be_and_why_it_is_fixed(ros: Ros, nodes: Stage) -> None:
    remote = Remote(ros, "controller")
    names = ["controller.P_err", "controller.coupling", "duration_s"]
    live, choice, fixed = remote.call("describe_parameters", DescribeParameters, names=names).descriptors
    assert (live.read_only, live.type) == (False, ParameterType.PARAMETER_DOUBLE)
    assert live.floating_point_range[0].to_value == 1e3
    assert choice.additional_constraints.startswith("one of yaw_rate")
    assert fixed.read_only
    assert fixed.additional_constraints == "read-only: the steps of the flight are counted at the start"
    (value,) = remote.call("get_parameters", GetParameters, names=["controller.P_err"]).values
    assert value.double_value == 1e-4


def test_a_parameter_cannot_be_taken_away(ros: Ros, nodes: Stage) -> None:
    remote = Remote(ros, "controller")
    assert not remote.set(controller__P_err=None).successful
    assert nodes.nodes["controller"].get_parameter("controller.P_err").value == 1e-4


def test_a_request_that_makes_no_sense_ends_no_node(ros: Ros, nodes: Stage) -> None:
    remote = Remote(ros, "controller")
    (parameter,) = _messages({"controller__P_err": 3e-4})
    parameter.value.type = 200
    remote.call("set_parameters_atomically", SetParametersAtomically, parameters=[parameter])
    assert remote.set(controller__P_err=3e-4).successful


def test_what_was_set_before_the_flight_counts_from_its_beginning(ros: Ros, nodes: Stage) -> None:
    """Unconfigured nodes take it in when they are configured; the plant then tells the scenario as changed."""
    values = {"plant.damping.Cm_damp_roll": 1.5, "controller.P_err": 4e-4, "reference.amplitude_deg_s": 200.0}
    listener = ros.partner("listener")
    scenarios, changes = listener.hear(topics.SCENARIO), listener.hear(topics.CHANGES)
    for name, value in values.items():
        assert Remote(ros, name.partition(".")[0]).set(**{name.replace(".", "__"): value}).successful
    plant = nodes.nodes["plant"]
    managers = [Manager(ros, kind) for kind in ("plant", "controller", "reference")]
    for number in (CONFIGURE, ACTIVATE):
        assert all(manager.transition(number) for manager in managers)
    ros.spin_until(lambda: plant.done)
    ros.spin_until(lambda: len(changes) == 2)
    assert "Cm_damp_roll: 1.5" in scenarios[-1].data
    told = {record["node"]: record for record in (json.loads(message.data) for message in changes)}
    assert {node: record["step"] for node, record in told.items()} == {"controller": 0, "reference": 0}
    base = load_scenario(SCENARIO, {"duration_s": 0.3} | values)
    # The controller's own model is that of its node, where the plant was not changed.
    pilot = build_controller(load_scenario(SCENARIO, {"duration_s": 0.3, "controller.P_err": 4e-4}))
    body, reference = build_plant(base), build_reference(base)
    state, applied = body.initial_state(), body.initial_applied()
    for k in range(base.steps):
        decision = pilot.decide(state, reference.preview(k, pilot.preview_steps + 1))
        before, applied = applied, body.actuate(decision.control, applied)
        state = body.step(state, before, applied)
    assert plant._state.tobytes() == state.tobytes()


def test_a_change_is_told_in_the_next_flight_too(ros: Ros) -> None:
    stage = Stage(ros, 2.0)
    stage.add("controller", "reference")
    plant = stage.add("plant", autostart=False)
    changes = ros.partner("listener").hear(topics.CHANGES)
    manager, remote = Manager(ros, "plant"), Remote(ros, "controller")
    for _ in range(2):
        assert all(manager.transition(number) for number in (CONFIGURE, ACTIVATE))
        ros.spin_until(lambda: plant.k >= 10)
        assert remote.set(controller__P_err=4e-4).successful
        ros.spin_until(lambda: plant.done)
        assert all(manager.transition(number) for number in (DEACTIVATE, CLEANUP))
    ros.spin_until(lambda: len(changes) == 2)
    first, second = (json.loads(message.data) for message in changes)
    assert (second["step"], second["control"]) == (0, None)
    assert first["step"] > 0
    assert first["parameters"] == second["parameters"] == {"controller.P_err": 4e-4}


def test_a_horizon_that_the_present_reference_can_serve_never_waits(ros: Ros, tmp_path: Path) -> None:
    """The longest that is allowed, over several chunks, while the reference comes no earlier than it must."""
    stage = RecordedStage(ros, tmp_path / "bag", chunk_steps=20)
    remote = Remote(ros, "controller")
    ahead = stage.nodes["controller"].scenario.preview_steps
    refused = remote.set(controller__horizon_steps=ahead + 21)
    assert "the present reference serves" in refused.reason
    most = int(refused.reason.split("serves ")[1].split(":")[0])
    assert most == ahead + 20
    assert remote.set(controller__horizon_steps=most).successful
    stage.fly_on()
    assert stage.nodes["plant"].sent_again == 0
    assert check(stage.folder)["equal"]


def test_a_controller_process_takes_a_change_in_flight(ros: Ros, processes: Processes) -> None:
    stage = Stage(ros, 600.0)
    plant = stage.add("plant")
    stage.add("reference")
    controller = processes.start("controller", overrides(600.0))
    changes = ros.partner("listener").hear(topics.CHANGES)
    ros.spin_until(lambda: plant.k > 20)
    remote = Remote(ros, "controller")
    assert remote.set(controller__P_err=4e-4).successful
    ros.spin_until(lambda: changes)
    k = plant.k
    ros.spin_until(lambda: plant.k > k + 20)
    assert not controller.ended
    assert json.loads(changes[0].data)["parameters"] == {"controller.P_err": 4e-4}
