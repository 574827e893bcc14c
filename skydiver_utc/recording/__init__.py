"""Recordings as rosbag2 bags in MCAP: bytes in, bytes out, no ROS needed.

`writer` stores serialized messages, `schemas` finds the definitions that make a bag explain itself,
`stamps` reads the stamp of a serialized message and `reader` gives the messages back. Import from the
modules: a recorder then does not pay for loading the reader's libraries.
"""
