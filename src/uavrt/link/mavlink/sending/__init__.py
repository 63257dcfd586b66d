"""Messages to the ground: bytes a second (`rate`), gaps and order (`pacing`), routes.

`rate` limits the link by the radio's buffer or by round trips, `pacing` by what an autopilot
forwards. `sender` sends, `routes` chooses the link; `signing`, `statustext`, `named_value`.
"""
