# SPDX-License-Identifier: Apache-2.0
"""ROS for tests: nodes of one process on one executor, node processes, each test on a domain of its own.

PYTEST_DONT_REWRITE: tests import names from here before pytest loads it as a plugin.
"""

import json
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest
import rclpy
from child_processes import PATIENCE_S, wait_until
from node_child import fork_node
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.controller_node import ControllerNode
from skydiver_utc.nodes.estimator_node import EstimatorNode
from skydiver_utc.nodes.plant_node import PlantNode
from skydiver_utc.nodes.recorder_node import RecorderNode
from skydiver_utc.nodes.reference_node import ReferenceNode
from skydiver_utc.nodes.topics import NAMESPACE, Topic

pytest_plugins = ("ros_domains",)

SCENARIO = "fast_turn_unknown_dynamics"
KINDS: dict[str, Any] = {
    "plant": PlantNode,
    "controller": ControllerNode,
    "reference": ReferenceNode,
    "estimator": EstimatorNode,
    "recorder": RecorderNode,
}
# The state of a plant without a pose, such as the cart of `own_slots`.
JOINT_STATE = topics.STATE.of_type(topics.STATE_TYPES["joint_state"])

_EVERY_MESSAGE = 10_000


def overrides(duration_s: float = 0.1, **others: object) -> dict[str, object]:
    """Parameters of a short flight; a double underscore stands for a dot."""
    return {
        "scenario": SCENARIO,
        "duration_s": duration_s,
        **{n.replace("__", "."): v for n, v in others.items()},
    }


class Ros:
    """One context and one executor; `add` what shall live there, `spin_until` a condition."""

    def __init__(self, domain: int) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self.executor = EventsExecutor(context=self.context)
        self._nodes: list[Node] = []

    def add(self, node: Any) -> Any:
        """Spin this node too; returns it."""
        self.executor.add_node(node)
        self._nodes.append(node)
        return node

    def node(self, kind: str, given: Mapping[str, object]) -> Any:
        """A node of the package with these parameters."""
        return self.add(KINDS[kind](self.context, dict(given)))

    def start(self, given: Mapping[str, object], *kinds: str) -> list[Any]:
        """Several of them with the same parameters."""
        return [self.node(kind, given) for kind in kinds]

    def remove(self, node: Any) -> None:
        """Take a node away, as if its process had ended."""
        self._nodes.remove(node)
        self.executor.remove_node(node)
        # The events executor still calls back for what came before.
        self.spin_for(0.1)
        node.destroy_node()

    def partner(self, name: str = "partner") -> "Partner":
        """A plain node that plays the other side."""
        return self.add(Partner(name, self.context))

    def spin_until(self, condition: Callable[[], object]) -> None:
        """Spin until the condition holds; fail when it does not come true."""
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline, "the condition did not come true"
            self.executor.spin_once(timeout_sec=0.02)

    def spin_for(self, seconds: float) -> None:
        """Spin for some time, to see that something does not happen."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.02)

    def close(self) -> None:
        """End everything."""
        for node in self._nodes:
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown(context=self.context)


@contextmanager
def spinning(ros: Ros) -> Iterator[None]:
    """The nodes work in a thread of their own, as they do in their processes."""
    done = threading.Event()

    def spin() -> None:
        while not done.is_set():
            ros.executor.spin_once(timeout_sec=0.02)

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


class Partner(Node):
    """Receives topics into lists and publishes whatever a test wants."""

    def __init__(self, name: str, context: Context) -> None:
        super().__init__(name, namespace=NAMESPACE, context=context)
        self._publishers_by_topic: dict[Topic, Any] = {}
        self._clients_by_service: dict[str, Any] = {}

    def receive(
        self, topic: Topic, then: Callable[[Any], None] | None = None, raw: bool = False
    ) -> list[Any]:
        """Subscribe with room for a whole run; every message, or its bytes, goes into the list, then to `then`."""
        messages: list[Any] = []

        def take(message: Any) -> None:
            messages.append(message)
            if then is not None:
                then(message)

        qos = QoSProfile(
            depth=_EVERY_MESSAGE, reliability=topic.qos.reliability, durability=topic.qos.durability
        )
        self.create_subscription(topic.type, topic.name, take, qos, raw=raw)
        return messages

    def call(self, ros: "Ros", service: str, kind: Any, **fields: Any) -> Any:
        """Call a service of another node, as "plant/get_state"; returns its response."""
        if service not in self._clients_by_service:
            self._clients_by_service[service] = self.create_client(kind, service)
            ros.spin_until(self._clients_by_service[service].service_is_ready)
        future = self._clients_by_service[service].call_async(kind.Request(**fields))
        ros.spin_until(future.done)
        return future.result()

    def publisher(self, topic: Topic) -> Any:
        """The publisher of this topic, made at the first use."""
        if topic not in self._publishers_by_topic:
            self._publishers_by_topic[topic] = self.create_publisher(topic.type, topic.name, topic.qos)
        return self._publishers_by_topic[topic]


@pytest.fixture
def ros(domain: int) -> Iterator[Ros]:
    """ROS in this process, on a domain of its own."""
    instance = Ros(domain)
    try:
        yield instance
    finally:
        instance.close()


class Processes:
    """Node processes on one domain; those still there at the end are ended, by their ids."""

    def __init__(self, domain: int, folder: Path, stack: ExitStack) -> None:
        self.environment = os.environ | {"ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(folder)}
        self._folder = folder
        self._stack = stack
        self._count = 0

    def start(
        self,
        kind: str,
        parameters: Mapping[str, object],
        *arguments: str,
    ) -> "NodeProcess":
        """Start ``<kind>_node`` with these parameters and further arguments for ROS."""
        command = ["--ros-args", *arguments]
        for name, value in parameters.items():
            text = str(value).lower() if isinstance(value, bool) else value
            command += ["-p", f"{name}:={text}"]
        log = self._log(kind)
        return self._kept(NodeProcess(fork_node(kind, command, self.environment, log), log), kind, *command)

    def python(self, name: str, *arguments: str) -> "NodeProcess":
        """Start Python with these arguments; `name` is that of its log."""
        log = self._log(name)
        with log.open("w") as stream:
            process = subprocess.Popen(
                [sys.executable, *arguments],
                env=self.environment,
                cwd=self._folder,
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
            )
        return self._kept(NodeProcess(process, log), *arguments)

    def _log(self, name: str) -> Path:
        self._count += 1
        log = self._folder / f"{self._count}_{name}.log"
        log.touch()
        return log

    def _kept(self, node: "NodeProcess", *arguments: str) -> "NodeProcess":
        self._stack.callback(node.end, arguments)
        return node


class NodeProcess:
    """One node process and what it has printed."""

    def __init__(self, process: "subprocess.Popen[bytes] | BaseProcess", log: Path) -> None:
        self._process = process
        self._log = log

    @property
    def output(self) -> str:
        """Everything printed so far, stdout and stderr."""
        return self._log.read_text(encoding="utf-8")

    def reports(self) -> list[dict[str, Any]]:
        """The JSON lines printed so far: a plant's progress and its outcome."""
        return [json.loads(line) for line in self.output.splitlines() if line.startswith("{")]

    @property
    def exit_code(self) -> int | None:
        """None while the process is there; -N after signal N."""
        process = self._process
        return process.poll() if isinstance(process, subprocess.Popen) else process.exitcode

    @property
    def ended(self) -> bool:
        """True when the process is gone."""
        return self.exit_code is not None

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to this process only."""
        if not self.ended:
            os.kill(self._process.pid or 0, number)

    def wait(self) -> int:
        """The exit code, once it has ended."""
        wait_until(lambda: self.ended)
        return self.exit_code or 0

    def end(self, arguments: Sequence[str]) -> None:
        """Kill the process; what it printed stands in the report of a test that failed."""
        self.kill()
        print(f"{shlex.join(arguments)}:\n{self.output}")

    def kill(self) -> None:
        """End the process for certain."""
        self.signal(signal.SIGKILL)
        self.wait()


@pytest.fixture
def processes(domain: int, tmp_path: Path) -> Iterator[Processes]:
    """Node processes on a domain of their own, with `tmp_path` as their working directory."""
    with ExitStack() as stack:
        yield Processes(domain, tmp_path, stack)
