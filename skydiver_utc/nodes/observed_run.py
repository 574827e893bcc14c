# SPDX-License-Identifier: Apache-2.0
"""Node behind a page on a flight over ROS: subscribes to a run that has begun, and changes it as users ask."""

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.validate_namespace import validate_namespace
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from skydiver_utc.arrays import Array
from skydiver_utc.loop.build import build_reference, build_true_plant
from skydiver_utc.loop.tuned_scenario import plain
from skydiver_utc.messages import MessageError, StepGrid, fill_named, read_named, read_state
from skydiver_utc.messages.texts import read_outcome, run_id_of
from skydiver_utc.nodes import topics
from skydiver_utc.parameters import ParameterError, Scenario, from_yaml, leaves
from skydiver_utc.plants.protocol import Plant

_POLL_S = 0.05
_DISCOVERY_S = 2.0  # how long a controller's services are looked for
_ANSWER_S = 10.0  # another controller may have to be compiled


class ObservedRun:
    """The newest step k, state (n,), applied (a,) and reference (l,) of a namespace; ended: there was an outcome.

    telemetry: the controller's newest numbers by name, `solve_time` [s] among them; empty until some came.

    It subscribes to the state only once the plant's diagnostics count steps: a plant that waits for its subscribers
    must not take it for one of them. Raises `ParameterError` where no flight has begun within `patience_s`.
    """

    def __init__(self, namespace: str, patience_s: float = 30.0, context: Context | None = None) -> None:
        if context is None and not rclpy.ok():
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.namespace, self.ended = namespace.strip("/"), False
        try:
            validate_namespace(f"/{self.namespace}")
        except InvalidNamespaceException as error:
            raise ParameterError(
                f"{namespace!r} is not a valid namespace: take the name of a run, such as skydiver"
            ) from error
        self._node = Node("view", namespace=self.namespace, context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self._scenario: Scenario | None = None
        self._run_id = ""
        self._begun = False
        self._pushes = self._node.create_publisher(topics.PUSH.type, topics.PUSH.name, topics.PUSH.qos)
        self._parameters = AsyncParameterClient(self._node, topics.CONTROLLER)
        self._resets = self._node.create_client(Trigger, topics.RESET_SERVICE)
        self._lifecycle = self._node.create_client(ChangeState, f"{topics.PLANT}/change_state")
        self._subscribe(topics.SCENARIO, self._on_scenario)
        self._subscribe(topics.DIAGNOSTICS, self._on_diagnostics)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        self._wait(lambda: self._scenario is not None and self._begun, patience_s)
        assert self._scenario is not None
        self.scenario: Scenario = self._scenario
        self.plant: Plant = build_true_plant(self.scenario)
        self.tracked: tuple[str, ...] = build_reference(self.scenario).outputs
        self.k: int = -1
        self.state: Array = np.array(self.plant.initial_state(), dtype=float)
        self.applied: Array = np.array(self.plant.initial_applied(), dtype=float)
        self.reference: Array = np.zeros(len(self.tracked))
        self.telemetry: dict[str, float] = {}
        self._grid: StepGrid = StepGrid(self.scenario.stamp_ns(0), self.scenario.dt_ns, exact=False)
        self._subscribe(topics.STATE.of_plant(self.plant), self._on_state)
        self._subscribe(topics.APPLIED_COMMAND, self._on_applied)
        self._subscribe(topics.SETPOINT, self._on_setpoint)
        self._subscribe(topics.TELEMETRY, self._on_telemetry)
        self._subscribe(topics.OUTCOME, self._on_outcome)
        self._wait(lambda: self.k >= 0, patience_s)

    def close(self) -> None:
        """End the subscriptions."""
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()

    def push(self, change: Mapping[str, float]) -> None:
        """Add to states, by name, at the plant's next step."""
        self._pushes.publish(fill_named(JointState(name=list(change)), np.array(list(change.values()))))

    def reset(self) -> None:
        """Reset the plant's state at its next step. Raises `ParameterError` where the plant refuses."""
        answer = self._answer(self._resets.call_async(Trigger.Request()), self._resets.service_is_ready())
        if not answer.success:
            raise ParameterError(answer.message)

    def pause(self, paused: bool) -> None:
        """Let the run stand between two steps, or go on. Raises `ParameterError` where the plant refuses."""
        kind = Transition.TRANSITION_DEACTIVATE if paused else Transition.TRANSITION_ACTIVATE
        request = ChangeState.Request(transition=Transition(id=kind))
        if not self._answer(self._lifecycle.call_async(request), self._lifecycle.service_is_ready()).success:
            raise ParameterError(
                "the plant refuses: only a run in lockstep that has not ended can pause and go on"
            )

    def controller_parameters(self) -> dict[str, Any]:
        """The controller node's settings of its controller, by dotted name; empty for a node without them."""
        if not self._parameters.wait_for_services(_DISCOVERY_S):
            return {}
        names = [leaf.name for leaf in leaves(self.scenario) if leaf.name.startswith("controller.")]
        values = map(parameter_value_to_python, self._answer(self._parameters.get_parameters(names)).values)
        found = zip(names, values, strict=False)
        return {name: plain(value) for name, value in found if value is not None}

    def set_controller(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the controller node, all or none. Raises `ParameterError` where it refuses them."""
        parameters = [Parameter(name, value=value) for name, value in values.items()]
        answer = self._parameters.set_parameters_atomically(parameters)
        result = self._answer(answer, self._parameters.services_are_ready()).result
        if not result.successful:
            raise ParameterError(result.reason)

    def _answer(self, future: Future, there: bool = True) -> Any:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not (there and done.wait(_ANSWER_S)):
            raise ParameterError(f"a node of {self.namespace} does not answer: see whether it is running")
        return future.result()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return

    def _subscribe(self, topic: topics.Topic, receive: Callable[[Any], None]) -> None:
        """The newest message counts: no publisher waits for a page."""

        def callback(message: Any) -> None:
            try:
                receive(message)
            except (MessageError, ParameterError) as error:
                self._node.get_logger().warning(f"{topic.name}: {error}", throttle_duration_sec=5.0)

        each = topic.latched or topic is topics.DIAGNOSTICS
        self._node.create_subscription(topic.type, topic.name, callback, topic.qos if each else topics.NEWEST)

    def _wait(self, condition: Callable[[], bool], patience_s: float) -> None:
        ends_at = time.monotonic() + patience_s
        while not condition():
            if time.monotonic() > ends_at:
                self.close()
                raise ParameterError(
                    f"no flight has begun in the namespace {self.namespace}: start one, and set ROS_DOMAIN_ID to its"
                    " domain"
                )
            time.sleep(_POLL_S)

    def _on_scenario(self, message: Any) -> None:
        self._scenario, self._run_id = from_yaml(message.data), run_id_of(message.data)
        self.ended = False

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {each.key: each.value for each in status.values}
            with suppress(ValueError):  # anybody may publish diagnostics
                if status.name == f"{self.namespace}/{topics.PLANT}" and int(values.get("step", "-1")) > 0:
                    self._begun = True

    def _on_state(self, message: Any) -> None:
        self.state = read_state(message, self.plant.state_names)
        self.k = self._grid.step_of(message.header.stamp)

    def _on_applied(self, message: Any) -> None:
        control = read_named(message, self.plant.control_names)
        self.applied = np.append(control, self.applied[len(control) :])

    def _on_setpoint(self, message: Any) -> None:
        self.reference = read_named(message, self.tracked)

    def _on_telemetry(self, message: Any) -> None:
        values = read_named(message, message.name, finite=False)
        self.telemetry = dict(zip(message.name, values.tolist(), strict=True))

    def _on_outcome(self, message: Any) -> None:
        self.ended = self.ended or read_outcome(message.data)["run_id"] == self._run_id
