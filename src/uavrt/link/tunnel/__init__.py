"""The tunnel's wire formats: one file per generation of the protocol (`g0`, `g1`, `g2`).

`decode` reads a payload, ``message.encode()`` writes one, `uavrt.link.tunnel.tunnel_records`
converts between these messages and the records of `uavrt.core.messages`. Pure: no sockets, no
clock.
"""
