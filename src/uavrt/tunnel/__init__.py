"""The tunnel's wire formats: one file per generation of the protocol (`g0`, `g1`, `g2`).

`decode` reads a payload, ``message.encode()`` writes one, `uavrt.tunnel.convert` converts
between these messages and the records of `uavrt.messages`. Pure: no sockets, no clock.
"""
