"""What waits in UDP sockets of this computer."""

from pathlib import Path


def waiting_bytes(port: int) -> int:
    """Bytes at a UDP port that whoever listens there has not read yet."""
    total = 0
    for table in (Path("/proc/net/udp"), Path("/proc/net/udp6")):
        for line in table.read_text().splitlines()[1:] if table.exists() else ():
            _, local, _, _, queues = line.split()[:5]
            if int(local.rpartition(":")[2], 16) == port:
                total += int(queues.partition(":")[2], 16)
    return total
