"""Wire formats of the tunnel messages, with one module per protocol generation (`g0`, `g1`,
`g2`).

`decode` decodes a payload, ``message.encode()`` encodes a message, and
`uavrt.link.tunnel.tunnel_records` converts between these messages and the records of
`uavrt.core.messages`. These modules use neither sockets nor a clock.
"""
