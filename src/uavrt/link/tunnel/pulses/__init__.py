"""Delivery of pulses over a link that loses messages: receipts, repeats (`reliable`).

`reliable` handles receipts; `pulse_memory` drops a pulse once all confirmed stations have it.
`underway` finds lost messages; the ground acknowledges in `ground/link/delivery_receipts`.
"""
