"""A telemetry radio between an autopilot and a ground station, which can fall silent."""

import select
import socket
import threading
from types import TracebackType


class QuietRadio:
    """Passes datagrams on, both ways, unless it is silent.

    `port`: where the autopilot sends to.
    `ground_port`: where the ground station listens.
    """

    def __init__(self, port: int, ground_port: int) -> None:
        self._air = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._air.bind(("127.0.0.1", port))
        self._ground = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._ground.connect(("127.0.0.1", ground_port))
        # To send takes an error that `select` has told of; a read would then wait for ever.
        for sock in (self._air, self._ground):
            sock.setblocking(False)
        self._autopilot: tuple[str, int] | None = None
        self._ending = threading.Event()
        self.silent = False
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> "QuietRadio":
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ending.set()
        self._thread.join(10.0)
        self._air.close()
        self._ground.close()

    def _serve(self) -> None:
        while not self._ending.is_set():
            ready, _, _ = select.select([self._air, self._ground], [], [], 0.1)
            for sock in ready:
                try:
                    self._pass_on(sock)
                except OSError:
                    continue  # the ground station is not there at the moment

    def _pass_on(self, sock: socket.socket) -> None:
        content, sender = sock.recvfrom(4096)
        if sock is self._air:
            self._autopilot = sender
        if self.silent:
            return
        if sock is self._air:
            self._ground.send(content)
        elif self._autopilot is not None:
            self._air.sendto(content, self._autopilot)
