"""Turn candidates into reported pulses: test them, track them, and assign them to tags.

`search_band` searches the band of one tag. `judging` accepts or rejects a candidate group.
`tracks` and `following` track it, and `frequency_slide` measures how its frequency changes
within a pulse. `other_signals/other_bursts`, `chance` and
`transmitters/coincidence` compute the odds of a chance match. `transmitters/ghosts`,
`transmitters/train_senders`, `transmitters/trains` and `transmitters/train_assignment`
determine which tag sent the pulses.
"""
