"""Whom a UDP link answers when more ports speak to it than it keeps."""

from uavrt.link.mavlink.links.address import parse_address
from uavrt.link.mavlink.links.udp import MAX_PEERS, UdpLink


def test_the_peers_known_longest_stay_however_many_ports_speak() -> None:
    link = UdpLink(parse_address("udpin://127.0.0.1:14540"), lambda frame: None)
    autopilot = ("127.0.0.1", 14_580)
    link._remember(autopilot)
    for port in range(20_000, 22_000):
        link._remember(("192.0.2.7", port))
        assert autopilot in link._peers
        assert ("192.0.2.7", port) in link._peers, "the newest one is answered, too"
    assert len(link._peers) == MAX_PEERS
