"""MAVLink: links, heartbeat, discovery, poses, tunnel transport.

`Connection` is what the drone's connection process runs; `Component`, `TimeSync`, `PacedQueue`
and the other parts implement the protocol without I/O. `open_link` and `FrameWriter` are enough
for a ground station. The messages (`uavrt.link.mavlink.dialect`) are generated at package
build.
"""
