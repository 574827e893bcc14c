"""Every topic of the system in one table: name, type, quality of service, who publishes, who listens."""

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSLivelinessPolicy,
    QoSProfile,
    QoSReliabilityPolicy,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty, String
from trajectory_msgs.msg import JointTrajectory

NAMESPACE = "skydiver"

PLANT = "plant"
REFERENCE = "reference"
CONTROLLER = "controller"
RECORDER = "recorder"
EVERY_NODE = "every node"

# rmw's "infinite", as rosbag2 writes it.
_FOREVER = {"sec": 9223372036, "nsec": 854775807}


def _quality(depth: int, durability: QoSDurabilityPolicy) -> QoSProfile:
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=QoSReliabilityPolicy.RELIABLE,
        durability=durability,
    )


# The sender's history is what a listener that was held up can still get: more than two seconds of the fastest
# lockstep seen. With a depth of 10 a recorder that stands still for half a second loses messages.
EACH_STEP = _quality(5000, QoSDurabilityPolicy.VOLATILE)
CHUNKS = _quality(20, QoSDurabilityPolicy.TRANSIENT_LOCAL)
# For a listener to which only the newest counts: over a network that loses messages, a reliable one hears nothing
# new until what was lost has been sent again.
NEWEST = QoSProfile(depth=1000, reliability=QoSReliabilityPolicy.BEST_EFFORT)
LATCHED = _quality(1, QoSDurabilityPolicy.TRANSIENT_LOCAL)

# A listener with a lease hears no publisher without one. So the lease is on topics of its own: on those of the
# flight anybody may publish and listen with the default quality.
LEASE_S = 0.4
_LEASED = _quality(1, QoSDurabilityPolicy.VOLATILE)
_LEASED.liveliness = QoSLivelinessPolicy.AUTOMATIC
_LEASED.liveliness_lease_duration = Duration(seconds=LEASE_S)


@dataclass(frozen=True, eq=False)
class Topic:
    """One topic; `name` is relative to the node's namespace unless it begins with a slash."""

    name: str
    type: Any
    qos: QoSProfile
    publisher: str
    listeners: tuple[str, ...] = ()  # nodes that must hear every message, from the first
    fewer_than_states: int | None = None  # a flight of n states has n minus this; None: not one each step
    recorded: bool = True

    @property
    def type_name(self) -> str:
        """The type as ROS writes it, for example "nav_msgs/msg/Odometry"."""
        return f"{self.type.__module__.partition('.')[0]}/msg/{self.type.__name__}"

    @property
    def latched(self) -> bool:
        """True where a late listener still gets the newest message."""
        return bool(self.qos.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL)


SCENARIO = Topic("scenario", String, LATCHED, PLANT)
CLOCK = Topic("/clock", Clock, EACH_STEP, PLANT, fewer_than_states=0)
STATE = Topic("state", Odometry, EACH_STEP, PLANT, (CONTROLLER,), fewer_than_states=0)
REFERENCE_PREVIEW = Topic("reference", JointTrajectory, CHUNKS, REFERENCE)
SETPOINT = Topic("reference/setpoint", TwistStamped, EACH_STEP, REFERENCE, fewer_than_states=0)
CHANGES = Topic("changes", String, EACH_STEP, EVERY_NODE)
COMMAND = Topic("command", JointState, EACH_STEP, CONTROLLER, (PLANT,), fewer_than_states=1)
TELEMETRY = Topic("controller/telemetry", JointState, EACH_STEP, CONTROLLER, fewer_than_states=1)
APPLIED_COMMAND = Topic("applied_command", JointState, EACH_STEP, PLANT, fewer_than_states=1)
JOINT_STATES = Topic("joint_states", JointState, EACH_STEP, PLANT)
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, EACH_STEP, EVERY_NODE)
OUTCOME = Topic("outcome", String, LATCHED, PLANT)
RECORDER_READY = Topic("recorder/ready", String, LATCHED, RECORDER, recorded=False)
ROLL_CALL = Topic("roll_call", String, CHUNKS, EVERY_NODE, recorded=False)
# Several plants speak there: with a depth of 1 the word of one replaces that of another before it is heard.
CLOCK_SOURCE = Topic("/clock/source", String, CHUNKS, PLANT, recorded=False)
CLOCK_AWAITED = Topic("/clock/awaited", String, CHUNKS, PLANT, recorded=False)

# In causal order within one step: messages of one instant are recorded in this order.
TOPICS = (
    SCENARIO,
    CLOCK,
    STATE,
    REFERENCE_PREVIEW,
    SETPOINT,
    CHANGES,
    COMMAND,
    TELEMETRY,
    APPLIED_COMMAND,
    JOINT_STATES,
    DIAGNOSTICS,
    OUTCOME,
    RECORDER_READY,
    ROLL_CALL,
    CLOCK_SOURCE,
    CLOCK_AWAITED,
)
# By the kind of node whose process it stands for; nothing is sent on them.
ALIVE = {
    kind: Topic(f"alive/{kind}", Empty, _LEASED, kind, recorded=False)
    for kind in (PLANT, REFERENCE, CONTROLLER, RECORDER)
}
RECORDED = tuple(topic for topic in TOPICS if topic.recorded)


def rosbag2_qos(qos: QoSProfile) -> dict[str, object]:
    """An offered profile in the words of a rosbag2 (version 9) `metadata.yaml`."""
    return {
        "history": "keep_last",
        "depth": qos.depth,
        "reliability": "reliable",
        "durability": qos.durability.name.lower(),
        "deadline": dict(_FOREVER),
        "lifespan": dict(_FOREVER),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_FOREVER),
        "avoid_ros_namespace_conventions": False,
    }
