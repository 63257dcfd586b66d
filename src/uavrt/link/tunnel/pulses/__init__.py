"""Delivery of pulses over a link that loses messages: receipts, repeats (`reliable`).

`reliable` handles a receipt: `pulse_memory` forgets a pulse that no confirmed station lacks.
`underway` finds lost messages; the ground acknowledges in `ground/link/delivery_receipts`.
"""
