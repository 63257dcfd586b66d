"""ROS 2: the drone as ROS 2 nodes and topics, without installing ROS.

Only `uavrt.link.ros2.network.dds` needs the extra ``uavrt[ros2]``; messages, bytes and type
hashes do not.
"""
