"""One node as a process: help, environment, signals, and errors as one sentence. rclpy is imported late."""

import gc
import importlib
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import Any

from skydiver_utc import discovery
from skydiver_utc.nodes.exit_deadline import end_in_time
from skydiver_utc.nodes.usage import usage
from skydiver_utc.parameters import ParameterError
from skydiver_utc.recording.errors import RecordingError

_NODES = {
    "plant": ("lockstep_plant", "PlantNode"),
    "reference": ("preview_publisher", "ReferenceNode"),
    "controller": ("lockstep_controller", "ControllerNode"),
    "recorder": ("bag_recorder", "RecorderNode"),
    "player": ("bag_player", "PlayerNode"),
}
_REFUSED = 2
_LONGEST_GOODBYE_S = 5


class StopRequest:
    """SIGINT or SIGTERM: interrupts the start, later only sets `requested`.

    A further signal changes nothing, so that cleaning up is never cut short.
    """

    def __init__(self) -> None:
        self.requested = False
        self.deferred = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        first, self.requested = not self.requested, True
        if first and not self.deferred:
            raise KeyboardInterrupt


def run(kind: str, arguments: Sequence[str] | None = None) -> int:
    """Run a node until it has finished or a signal comes; returns the exit code."""
    arguments = list(sys.argv if arguments is None else arguments)
    try:
        if "--help" in arguments or "-h" in arguments:
            _print(usage(kind))
            return 0
        discovery.prepare(os.environ)
        return _run(kind, arguments)
    except KeyboardInterrupt:
        return 0
    except (ParameterError, RecordingError) as error:
        return _refuse(kind, str(error))
    except ImportError as error:
        if "rcl" not in str(error) and "rmw" not in str(error):
            raise
        return _refuse(kind, f"{error}: source a ROS 2 Jazzy environment, or install with the extra [ros]")


def _print(text: str) -> None:
    """On stdout; whoever reads it may close it early, as `head` does."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # The interpreter flushes once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _refuse(kind: str, sentence: str) -> int:
    print(f"{kind}_node: {sentence}", file=sys.stderr)
    return _REFUSED


def _node_class(kind: str) -> Any:
    module, name = _NODES[kind]
    return getattr(importlib.import_module(f"skydiver_utc.nodes.{module}"), name)


def _run(kind: str, arguments: list[str]) -> int:
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    from skydiver_utc.nodes.direct_loop import DirectLoop

    stop = StopRequest()
    try:
        others = remove_ros_args(arguments)[1:]
        if others:
            raise ParameterError(
                f"unknown argument {others[0]}: give parameters as --ros-args -p NAME:=VALUE"
            )
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise ParameterError(str(error).partition(", at /")[0]) from error
    try:
        node = _node_class(kind)()
        stop.deferred = True
        loop = DirectLoop(node)
        # What is there by now stays. The collector would go through it in flight, for longer than a step.
        gc.collect()
        gc.freeze()
        try:
            while not (node.finished or stop.requested):
                loop.spin_once()
        except ExternalShutdownException:
            pass
        code = int(node.close())
        if node.refused:
            code = _refuse(kind, node.refused)
        end_in_time(code, _LONGEST_GOODBYE_S)
        loop.shutdown()
        return code
    finally:
        rclpy.try_shutdown()
        # The interpreter gives signals back to the system before it ends: one that comes late would kill it then.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
