"""The links of a drone: MAVLink, the tunnel of the original inside it, and ROS 2.

`mavlink` is the protocol of autopilots, `tunnel` the messages to the ground station, `ros2` the
nodes and topics; `allowance` limits what a stranger can send.
"""
