"""Where nodes look for each other: on this machine, unless the environment opens the network to them."""

from collections.abc import MutableMapping

from skydiver_utc.parameters import ParameterError
from skydiver_utc.parameters.loading import config_folder

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"

_RANGES = ("LOCALHOST", "SUBNET", "OFF", "SYSTEM_DEFAULT")


def prepare(environment: MutableMapping[str, str]) -> None:
    """Complete the environment that nodes start in; what it says already stands.

    Discovery is LOCALHOST. The profile `config/network/fastdds.xml` lets lost messages be repaired within
    milliseconds, and a node that comes late hear at once. A range that ROS does not know raises `ParameterError`.
    """
    chosen = environment.setdefault(RANGE, "LOCALHOST")
    if chosen not in _RANGES:
        raise ParameterError(f"{RANGE} is {chosen!r}: it must be one of {', '.join(_RANGES)}")
    environment.setdefault(PROFILE, str(config_folder() / "network" / "fastdds.xml"))
