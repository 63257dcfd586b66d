"""Processes of the drone: short main loops that connect stages to sockets.

`receiver`, `detector`, `recorder`, `connection`, `guide`, `estimator` and `ros2_gateway` are
rows of the table of processes. `motions/motion_handler` and, in `connection_parts`,
`parameter_handler` and `pose_collector` are parts of the connection; `search_thread` is a part
of the guide.
"""
