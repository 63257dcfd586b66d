"""Links that carry frames: UDP, TCP and serial ports."""
