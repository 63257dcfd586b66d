"""Messages to the ground: link rate (`rate`), order and spacing (`pacing`), choice of link.

`rate` limits the link by the radio's buffer or by round trips, `pacing` by what an autopilot
forwards. `sender` sends, `routes` chooses the link; `signing`, `statustext`.
"""
