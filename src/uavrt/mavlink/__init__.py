"""MAVLink: links, heartbeat, discovery, poses, tunnel transport."""
