"""The DDS network of ROS 2."""
