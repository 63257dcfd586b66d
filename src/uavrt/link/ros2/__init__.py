"""Show the drone on ROS 2 as nodes and topics, without an installation of ROS.

Only `uavrt.link.ros2.network.dds` needs the extra ``uavrt[ros2]``. The message types, their
encoding and their type hashes need no other package.
"""
