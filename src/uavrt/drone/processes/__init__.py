"""Processes of the drone: short main loops that connect stages to sockets.

`receiver`, `detector`, `recorder`, `connection`, `guide`, `estimator` and `ros2_gateway` are
rows of the table of processes. `motion_desk`, `parameter_desk` and `pose_desk` are parts of the
connection, `search_thread` of the guide.
"""
