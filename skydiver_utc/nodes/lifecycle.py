# SPDX-License-Identifier: Apache-2.0
"""A ROS 2 lifecycle node: a transition is a method, and an error in it is one sentence."""

import traceback
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.lifecycle.managed_entity import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.timer import Timer

from skydiver_utc.errors import RecordingError
from skydiver_utc.parameters import ParameterError

UNCONFIGURED, ACTIVE = "unconfigured", "active"
_STARTUP_POLL_S = 0.02


class RefusedError(ValueError):
    """The node cannot do this now; a sentence on why, and on what to do."""


class NotNeededError(Exception):
    """The scenario has no use for this node: its process ends with exit code 0 and this sentence."""


# What ends a node in one sentence; any other error is one of the program.
REFUSALS = (RefusedError, ParameterError, RecordingError)


@contextmanager
def destroyed_on_error(node: Node) -> Iterator[None]:
    """Destroy a node whose constructor fails: it would stay in the graph, and its shared memory on the machine."""
    with ExitStack() as on_error:
        on_error.callback(node.destroy_node)
        yield
        on_error.pop_all()


class ManagedNode(LifecycleNodeMixin, Node):
    """Subclasses say what `configure`, `activate`, `deactivate`, `cleanup` and `shutdown` do.

    Where one raises one of `REFUSALS` the node stays in its state and logs the sentence. Any other error is logged
    and finalizes the node.
    """

    def __init__(self, name: str, namespace: str, context: Context | None) -> None:
        self.active = self.shut_down = False
        self.last_transition = ""
        self._error: Exception | None = None
        self._begins: Timer | None = None
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        for transition in ("configure", "activate", "deactivate", "cleanup", "shutdown"):
            setattr(self, f"on_{transition}", partial(self._carry_out, transition))
        Node.__init__(self, name, namespace=namespace, context=context)
        LifecycleNodeMixin.__init__(self)
        for service in self.services:
            service.callback = self._guarded(service.srv_name, service.callback)

    def configure(self) -> None:
        """Prepare for `activate`."""

    def activate(self) -> None:
        """Begin to work, or continue."""

    def deactivate(self) -> None:
        """Stop working; `activate` continues from here."""
        self.end_startup()

    def cleanup(self) -> None:
        """Undo `configure`."""

    def shutdown(self) -> None:
        """End in order, from any state."""
        self.deactivate()

    @property
    def lifecycle(self) -> str:
        """The present state: unconfigured, inactive, active or finalized."""
        return str(self._state_machine.current_state[1])

    def every(self, period_s: float, callback: Callable[[], None]) -> Timer:
        """A timer on the steady clock, whatever simulated time does."""
        return self.create_timer(period_s, callback, clock=self._steady_clock)

    def begin_when(self, ready: Callable[[], bool], begin: Callable[[], None]) -> None:
        """Call `begin` once, as soon as `ready` and unless `end_startup` comes before."""

        def look() -> None:
            # An executor may call a timer once more that was destroyed.
            if self._begins is timer and ready():
                self.end_startup()
                begin()

        self._begins = timer = self.every(_STARTUP_POLL_S, look)

    def end_startup(self) -> None:
        """Begin no more."""
        if self._begins is not None:
            self.destroy_timer(self._begins)
            self._begins = None

    def start(self) -> None:
        """Configure and activate; an error is raised."""
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                assert self._error is not None
                raise self._error

    def destroy_node(self) -> None:
        """As any node; rclpy forgets the state machine, which would keep the node alive."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def on_error(self, state: Any) -> Any:
        """After an error of the program the node is finalized, and its process ends."""
        self.active, self.shut_down = False, True
        return TransitionCallbackReturn.FAILURE

    def _carry_out(self, transition: str, _: Any) -> Any:
        """The callback of rclpy for a transition; nothing keeps a node from shutting down."""
        self.shut_down = self.shut_down or transition == "shutdown"
        try:
            getattr(self, transition)()
        except REFUSALS as error:
            self._error = error
            self.active = self.active and not self.shut_down
            self.last_transition = f"{transition} refused: {error}"
            self.get_logger().error(f"cannot {transition}: {error}")
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            # rclpy would go on without a word.
            self._error = error
            self.last_transition = f"{transition} failed: {error!r}"
            self.get_logger().fatal(f"{self.last_transition}\n{traceback.format_exc()}")
            raise
        self.active, self.last_transition = transition == "activate", transition
        return TransitionCallbackReturn.SUCCESS

    def _guarded(self, name: str, callback: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """Answer a request that makes no sense with an empty response, where rclpy would end the process."""

        def answer(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except (rclpy_implementation.RCLError, ValueError, TypeError) as error:
                self.get_logger().warning(f"refused a request on {name}: {str(error).partition(', at ')[0]}")
                return response

        return answer
