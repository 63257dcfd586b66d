"""Sources of radio samples: radio programs, pipes and files behind one interface.

`source` is the interface, `opening` chooses a source. `radio_programs` starts a radio's
program, `soapy` its driver; `sample_stream`, `wav` and `sigmf` read pipes and files. `losses`,
`sample_times` and `sanity` find lost samples, give each sample its time, and reject impossible
data.
"""
