"""Links of a drone: MAVLink, the original system's tunnel inside MAVLink, and ROS 2.

`mavlink` is the protocol of autopilots, `tunnel` the messages to the ground station, `ros2` the
nodes and topics; `allowance` limits the rate of unauthenticated requests.
"""
