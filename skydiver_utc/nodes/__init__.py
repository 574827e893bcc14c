"""The flight over ROS 2: plant, reference, controller and recorder, each a node; only this room imports rclpy.

A node turns messages into arrays, calls the core, and turns arrays into messages. `topics` is the one table of
topics, `messages`, `preview` and `stamps` are the border, `process` runs a node until it ends or is stopped.

How a flight starts, in any order of the nodes: the reference sends its first chunk when it hears the clock's
publisher; the controller listens to the state when it has that chunk and is heard; the plant begins when a
controller listens. Where a recorder is awaited, each also waits until the recorder hears it. `roll_call` sees to
it that there is one node of a kind, `diagnostics` tells once a second how each of them is. `managed` gives a
node its lifecycle, `live_parameters` what can be set in flight.
"""
