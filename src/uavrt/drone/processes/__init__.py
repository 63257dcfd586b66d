"""Processes of the drone: short main loops that connect stages to sockets.

`receiver`, `detector`, `recorder`, `connection`, `guide`, `estimator` and `ros2_gateway` are
rows of the table of processes. `motions/motion_desk`, `connection_parts/parameter_desk` and
`connection_parts/pose_desk` are parts of the connection, `search_thread` of the guide.
"""
