"""Delivery of pulses over a link that loses messages: receipts, repeats (`reliable`).

`reliable` handles receipts: once all confirmed stations have a pulse, `pulse_memory` drops it.
`underway` finds lost messages; the ground acknowledges in `ground/link/delivery_receipts`.
"""
