# SPDX-License-Identifier: Apache-2.0
"""The run over ROS 2: each slot a node, a recorder and a player; only this room imports rclpy.

A node turns messages into arrays (`skydiver_utc.messages`), calls the object of its slot, and turns arrays into
messages. `topics` is the table of all topics, `node` the base class, `lifecycle` the transitions; `process` runs a
node until it ends or is stopped.

How a run starts, in any order of the nodes: the reference publishes its first chunk, which is latched, when the
plant's scenario comes, as then every message of its clock will; the controller subscribes to the state when it has
that chunk, or to the estimate, whose node then subscribes to the plant; the plant begins when one of them is
subscribed. With `wait_for_recorder` each also waits until its topics are recorded.
"""
