"""Socket pairs for channel samples. The supervisor makes them but does not read them."""

import socket

SEND_BUFFER_BYTES = 4 * 1024 * 1024


def make_sample_sockets() -> tuple[socket.socket, socket.socket]:
    """Make a socket pair (sending end, receiving end) with the largest allowed buffer."""
    sender, receiver = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    sender.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    return sender, receiver
