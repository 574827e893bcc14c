# SPDX-License-Identifier: Apache-2.0
"""Every topic in one table: name, type, quality of service, who must be subscribed."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log, ParameterEvent
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, Imu, JointState, MagneticField
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

if TYPE_CHECKING:  # the recorder starts without numba
    from skydiver_utc.plants.protocol import Plant

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # PyPI has no wheel of it: Foxglove and Lichtblick take single transforms, too
    TFMessage = None

NAMESPACE = "skydiver"

PLANT = "plant"
REFERENCE = "reference"
ESTIMATOR = "estimator"
CONTROLLER = "controller"
RECORDER = "recorder"


def _quality(depth: int, durability: QoSDurabilityPolicy) -> QoSProfile:
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=QoSReliabilityPolicy.RELIABLE,
        durability=durability,
    )


# A subscriber that was blocked receives the publisher's history: more than two seconds of the fastest lockstep
# measured. With a depth of 10 a recorder that blocks for half a second loses messages.
EACH_STEP = _quality(5000, QoSDurabilityPolicy.VOLATILE)
LOG = _quality(1000, QoSDurabilityPolicy.TRANSIENT_LOCAL)
CHUNKS = _quality(20, QoSDurabilityPolicy.TRANSIENT_LOCAL)
LATCHED = _quality(1, QoSDurabilityPolicy.TRANSIENT_LOCAL)
# For subscribers in real time: over a network that loses messages a reliable subscriber receives nothing new until
# the lost messages have been retransmitted.
NEWEST = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT)
EACH_AS_IT_COMES = QoSProfile(depth=1000, reliability=QoSReliabilityPolicy.BEST_EFFORT)


@dataclass(frozen=True, eq=False)
class Topic:
    """One topic; `name` is relative to the node's namespace unless it begins with a slash."""

    name: str
    type: Any
    qos: QoSProfile
    subscribers: tuple[str, ...] = ()  # nodes that must get every message, from the first on
    fewer_than_states: int | None = None  # a run of n states has n minus this; None: not one each step
    recorded: bool = True
    needed: bool = False  # a recorder waits for its publisher
    types: tuple[Any, ...] = ()  # those that it may have, by plant and settings; empty: the one

    def of_type(self, message_type: Any) -> "Topic":
        """The same topic with another type of message."""
        return replace(self, type=message_type)

    def of_plant(self, plant: "Plant") -> "Topic":
        """The same topic with the message in which this plant has its state."""
        return self.of_type(STATE_TYPES[plant.state_message])

    @property
    def type_name(self) -> str:
        """The type as ROS writes it, for example "nav_msgs/msg/Odometry"."""
        return f"{self.type.__module__.partition('.')[0]}/msg/{self.type.__name__}"

    @property
    def latched(self) -> bool:
        """True where a late subscriber still gets the newest message."""
        return bool(self.qos.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL)


STATE_TYPES = {"odometry": Odometry, "joint_state": JointState}  # by `Plant.state_message`
COMMAND_TYPES = {"joint_state": JointState, "float64_multi_array": Float64MultiArray, "twist": Twist}
SENSOR_TYPES = {kind.__name__: kind for kind in (Imu, MagneticField, FluidPressure, TwistStamped, JointState)}
_STATES, _COMMANDS = tuple(STATE_TYPES.values()), tuple(COMMAND_TYPES.values())

# In causal order within one step: messages of one instant are recorded in this order.
SCENARIO = Topic("scenario", String, LATCHED)
CLOCK = Topic("/clock", Clock, EACH_STEP, fewer_than_states=0, needed=True)
STATE = Topic("state", Odometry, EACH_STEP, (CONTROLLER,), fewer_than_states=0, needed=True, types=_STATES)
ESTIMATE = Topic("estimate", Odometry, EACH_STEP, (CONTROLLER,), fewer_than_states=1, types=_STATES)
ESTIMATOR_TELEMETRY = Topic("estimator/telemetry", JointState, EACH_STEP, fewer_than_states=1)
DISTURBANCE = Topic("disturbance", JointState, EACH_STEP, fewer_than_states=0)
PUSH = Topic("push", JointState, EACH_STEP, recorded=False)
PUSHED = Topic("pushed", JointState, EACH_STEP)
STICK = Topic("stick", TwistStamped, EACH_AS_IT_COMES)
REFERENCE_PREVIEW = Topic("reference", JointTrajectory, CHUNKS, needed=True)
SETPOINT = Topic("reference/setpoint", JointState, EACH_STEP, fewer_than_states=0)
CHANGES = Topic("changes", String, EACH_STEP)
COMMAND = Topic("command", JointState, EACH_STEP, (PLANT,), fewer_than_states=1, needed=True, types=_COMMANDS)
TELEMETRY = Topic("controller/telemetry", JointState, EACH_STEP, fewer_than_states=1)
APPLIED_COMMAND = Topic("applied_command", JointState, EACH_STEP, fewer_than_states=1, needed=True)
ROBOT_DESCRIPTION = Topic("robot_description", String, LATCHED)
JOINT_STATES = Topic("joint_states", JointState, EACH_STEP)
MARKERS = Topic("markers", MarkerArray, EACH_STEP)
TRANSFORMS = (
    Topic("/tf", TFMessage, EACH_STEP) if TFMessage else Topic("transforms", TransformStamped, EACH_STEP)
)
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, EACH_STEP)
LOGS = Topic("/rosout", Log, LOG)
PARAMETER_EVENTS = Topic("/parameter_events", ParameterEvent, EACH_STEP)
OUTCOME = Topic("outcome", String, LATCHED)
RECORDER_READY = Topic("recorder/ready", String, LATCHED, recorded=False)
TOPICS = tuple(each for each in list(globals().values()) if isinstance(each, Topic))
RECORDED = tuple(topic for topic in TOPICS if topic.recorded)

# Resets the plant to its initial state.
RESET_SERVICE = f"{PLANT}/reset"


def sensor_topic(name: str, message: str = "JointState") -> Topic:
    """The topic of a sensor, by its name and the type of its message."""
    types = tuple(SENSOR_TYPES.values())
    return Topic(f"sensors/{name}", SENSOR_TYPES[message], EACH_STEP, (ESTIMATOR,), types=types)
