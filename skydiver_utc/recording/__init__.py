# SPDX-License-Identifier: Apache-2.0
"""Recordings as rosbag2 bags in MCAP: serialized messages in, serialized messages out; no ROS needed.

`writer` writes bags, `reader` reads them, `recovery` repairs them, `playback` schedules a replay.
Import from the modules, each of which needs other libraries.
"""
