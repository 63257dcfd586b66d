"""Wire formats of the tunnel: one module for each protocol generation (`g0`, `g1`, `g2`).

`decode` reads a payload, ``message.encode()`` writes one, `uavrt.link.tunnel.tunnel_records`
converts between these messages and the records of `uavrt.core.messages`. No sockets, no
clock.
"""
