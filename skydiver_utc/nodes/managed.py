"""A managed node (ROS 2 lifecycle): what a transition does is a method, what goes wrong in it one sentence.

rclpy's executor looks at every service of a node each time that it waits. Services are called by people, now and
then: here a timer serves them, so that they cost a flight nothing.
"""

import traceback
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.lifecycle.managed_entity import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.service import Service
from rclpy.timer import Timer

from skydiver_utc.nodes.polled import Polled
from skydiver_utc.parameters import ParameterError
from skydiver_utc.recording.errors import RecordingError

_SERVICE_PERIOD_S = 0.1
UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = "unconfigured", "inactive", "active", "finalized"


class TransitionError(ValueError):
    """A transition makes no sense now; one sentence that says why and what to do."""


class ManagedNode(LifecycleNodeMixin, Node):
    """Subclasses say what `configure`, `activate`, `deactivate`, `cleanup` and `shutdown` do.

    Where one raises `TransitionError`, `ParameterError` or `RecordingError` the node stays in the state that it was
    in, and says the sentence. Any other error is one of the program: it is logged and finalizes the node.
    """

    def __init__(self, name: str, namespace: str, context: Context | None) -> None:
        self.active = False
        self.shut_down = False
        self.last_transition = ""
        self._trouble: Exception | None = None
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        Node.__init__(self, name, namespace=namespace, context=context)
        served = Polled()
        LifecycleNodeMixin.__init__(self, callback_group=served)
        for service in self.services:
            service.callback_group = served
        self.every(_SERVICE_PERIOD_S, self._serve_requests)

    def configure(self) -> None:
        """Make ready what activity needs."""

    def activate(self) -> None:
        """Begin to work, or go on."""

    def deactivate(self) -> None:
        """Stop working, and keep what going on needs."""

    def cleanup(self) -> None:
        """Forget what was configured."""

    def shutdown(self) -> None:
        """End in order, from any state."""

    @property
    def lifecycle(self) -> str:
        """The present state: unconfigured, inactive, active or finalized."""
        return str(self._state_machine.current_state[1])

    def every(self, period_s: float, callback: Callable[[], None]) -> Timer:
        """A timer on the steady clock, whatever simulated time does."""
        return self.create_timer(period_s, callback, clock=self._steady_clock)

    def start(self) -> None:
        """Configure and activate; what goes wrong is raised, and nothing is left of the node."""
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                self.destroy_node()
                assert self._trouble is not None
                raise self._trouble

    def destroy_node(self) -> None:
        """As any node; rclpy forgets the state machine, which would keep the node alive."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def on_configure(self, state: Any) -> Any:
        """Called by rclpy."""
        return self._carry_out("configure", self.configure, False)

    def on_activate(self, state: Any) -> Any:
        """Called by rclpy."""
        return self._carry_out("activate", self.activate, True)

    def on_deactivate(self, state: Any) -> Any:
        """Called by rclpy."""
        return self._carry_out("deactivate", self.deactivate, False)

    def on_cleanup(self, state: Any) -> Any:
        """Called by rclpy."""
        return self._carry_out("cleanup", self.cleanup, False)

    def on_shutdown(self, state: Any) -> Any:
        """Called by rclpy; nothing keeps a node from ending."""
        done = self._carry_out("shutdown", self.shutdown, False)
        self.active, self.shut_down = False, True
        return done

    def on_error(self, state: Any) -> Any:
        """After an error of the program the node is finalized, and its process ends."""
        self.active, self.shut_down = False, True
        return TransitionCallbackReturn.FAILURE

    def _carry_out(self, transition: str, action: Callable[[], None], active_then: bool) -> Any:
        try:
            action()
        except (TransitionError, ParameterError, RecordingError) as error:
            self._trouble = error
            self.last_transition = f"{transition} refused: {error}"
            self.get_logger().error(f"cannot {transition}: {error}")
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            # rclpy would go on without a word.
            self._trouble = error
            self.last_transition = f"{transition} failed: {error!r}"
            self.get_logger().fatal(f"{self.last_transition}\n{traceback.format_exc()}")
            raise
        self.active, self.last_transition = active_then, transition
        return TransitionCallbackReturn.SUCCESS

    def _serve_requests(self) -> None:
        for service in list(self.services):
            while (taken := _take_request(service))[1] is not None:
                request, header = taken
                service.send_response(self._answer(service, request), header)

    def _answer(self, service: Service, request: Any) -> Any:
        """The response to a request; to one that makes no sense, an empty one."""
        try:
            return service.callback(request, service.srv_type.Response())
        except (rclpy_implementation.RCLError, ValueError, TypeError) as error:
            sentence = str(error).partition(", at ")[0]
            self.get_logger().warning(f"refused a request on {service.srv_name}: {sentence}")
            return service.srv_type.Response()


def _take_request(service: Service) -> Any:
    """A request and its header, (None, None) without one."""
    with service.handle:
        return service.handle.service_take_request(service.srv_type.Request)
