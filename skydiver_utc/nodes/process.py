# SPDX-License-Identifier: Apache-2.0
"""One node as a process: help, environment, signals, and errors as one sentence. rclpy is imported late."""

import ctypes
import gc
import importlib
import os
import signal
import struct
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from types import FrameType

from skydiver_utc.errors import REFUSED, ParameterError
from skydiver_utc.nodes import discovery
from skydiver_utc.parameters.nodes import usage

_LOOK_S = 1.5  # discovery takes this long, on a busy machine longer
_WAIT_S = 0.05
_LONGEST_END_S = 5


class StopRequest:
    """SIGINT or SIGTERM: interrupts the start, later only sets `requested`; a further one changes nothing."""

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
            print(usage(kind), flush=True)
            return 0
        discovery.prepare(os.environ)
        return _run(kind, arguments)
    except KeyboardInterrupt:
        return 0
    except BrokenPipeError:  # whoever reads the help may close it early, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except ParameterError as error:
        return _refuse(kind, str(error))
    except ImportError as error:
        if "rcl" not in str(error) and "rmw" not in str(error):
            raise
        return _refuse(kind, f"{error}: source a ROS 2 Jazzy environment, or install with the extra [ros]")


def _refuse(kind: str, sentence: str) -> int:
    print(f"{kind}_node: {sentence}", file=sys.stderr)
    return REFUSED


def _run(kind: str, arguments: list[str]) -> int:
    import rclpy
    import rclpy.logging
    from rclpy.executors import ExternalShutdownException
    from rclpy.experimental import EventsExecutor
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    from skydiver_utc.nodes.lifecycle import REFUSALS, NotNeededError

    stop = StopRequest()
    try:
        if others := remove_ros_args(arguments)[1:]:
            raise ParameterError(
                f"unknown argument {others[0]}: give parameters as --ros-args -p NAME:=VALUE"
            )
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise ParameterError(str(error).partition(", at /")[0]) from error
    executor = EventsExecutor()
    node = None
    # Objects made up to here are permanent: a garbage collection that visits them takes longer than a step.
    gc.disable()
    try:
        module = importlib.import_module(f"skydiver_utc.nodes.{kind}_node")
        if "numba" in sys.modules:  # else the node compiles nothing
            from skydiver_utc.jit import on_first_compilation

            on_first_compilation(rclpy.logging.get_logger(kind).info)
        node = getattr(module, f"{kind.capitalize()}Node")(look_s=_LOOK_S)
        stop.deferred = True
        gc.collect()
        gc.freeze()
        gc.enable()
        executor.add_node(node)
        with suppress(ExternalShutdownException):
            while not (node.finished or stop.requested):
                executor.spin_once(timeout_sec=_WAIT_S)  # spin() would not end on SIGTERM
        code = int(node.close())
        if node.refused:
            code = _refuse(kind, node.refused)
    except KeyboardInterrupt:
        code = 0
    except NotNeededError as error:
        print(f"{kind}_node: {error}", file=sys.stderr)
        code = 0
    except REFUSALS as error:
        code = _refuse(kind, str(error))
    _exit_within(_LONGEST_END_S, code)
    executor.shutdown()
    if node is not None:
        node.destroy_node()
    rclpy.try_shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _exit_within(seconds: int, code: int) -> None:
    """Let the C library end the process if it has not ended by then.

    Fast DDS 2.14 can hang while a node ends and others come or go, with Python's lock held. An exit
    without ending the node would leave its shared memory behind, 0.5 MB a process.
    """
    libc = ctypes.CDLL(None)
    exit_function = ctypes.cast(libc._exit, ctypes.c_void_p).value
    # struct sigevent: value, signal, SIGEV_THREAD, function; struct itimerspec: interval, time to go
    event = struct.pack("@Pii2P48x", code, 0, 2, exit_function, 0)
    timer = ctypes.c_void_p()
    if libc.timer_create(1, event, ctypes.byref(timer)) == 0:
        libc.timer_settime(timer, 0, struct.pack("@4l", 0, 0, seconds, 0), None)


# What the installed commands run: their help comes before rclpy is imported.
plant_node, reference_node, estimator_node, controller_node, recorder_node, player_node = (
    partial(run, kind) for kind in ("plant", "reference", "estimator", "controller", "recorder", "player")
)
