"""Message types of ROS 2, and their bytes."""
