# SPDX-License-Identifier: Apache-2.0
"""The discovery range of the nodes: this machine, unless the environment sets another one."""

from collections.abc import MutableMapping

from skydiver_utc.parameters import ParameterError
from skydiver_utc.parameters.loading import config_folder

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"

_RANGES = ("LOCALHOST", "SUBNET", "OFF", "SYSTEM_DEFAULT")


def prepare(environment: MutableMapping[str, str]) -> None:
    """Complete the environment of the nodes; variables that are set remain.

    Discovery is LOCALHOST. With the profile `config/network/fastdds.xml` lost messages are retransmitted within
    milliseconds, and a late subscriber matches at once. A range unknown to ROS raises `ParameterError`.
    """
    chosen = environment.setdefault(RANGE, "LOCALHOST")
    if chosen not in _RANGES:
        raise ParameterError(f"{RANGE} is {chosen!r}: it must be one of {', '.join(_RANGES)}")
    environment.setdefault(PROFILE, str(config_folder() / "network" / "fastdds.xml"))
