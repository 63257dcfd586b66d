"""Processes of the drone side: thin loops that connect stages to sockets.

`receiver`, `detector`, `recorder`, `connection`, `guide`, `estimator` and `ros2_gateway` are
rows of the table of processes. `motion_desk`, `parameter_desk` and `pose_desk` belong to the
connection, `thinker` to the guide.
"""
