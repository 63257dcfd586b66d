"""From candidates to reported pulses: judge, track, assign to a tag, report.

`search_band` searches the band of one tag; `judging` accepts or rejects a candidate group;
`tracks` and `following` track it. `other_bursts`, `chance` and `coincidence` compute the odds
of a chance match; `ghosts`, `train_senders`, `trains` and `train_assignment` determine the tag.
"""
