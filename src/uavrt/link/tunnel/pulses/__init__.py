"""Deliver all pulses over a link that loses messages.

`reliable` handles receipts and repeats lost messages. Once all confirmed stations have
acknowledged a pulse, `pulse_memory` drops it. `underway` detects lost messages. The ground
station acknowledges pulses in `ground/link/delivery_receipts`.
"""
