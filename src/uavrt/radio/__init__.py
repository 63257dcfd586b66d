"""Read radio samples from radio programs, pipes and files behind one interface.

`source` is the interface, `opening` chooses a source; `receivers` has the radios' programs,
`files` recordings. `timing` determines the samples' times and counts lost ones, `sanity`
rejects bad data.
"""
