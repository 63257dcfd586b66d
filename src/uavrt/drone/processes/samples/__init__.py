"""Parts of receiver and detector: raw capture, channel recording, hang detection, latency."""
