"""Sources of radio samples: radio programs, pipes and files behind one interface.

`source` is the interface, `opening` chooses a source. `programs` starts a radio's program,
`soapy` its driver; `stream`, `wav` and `sigmf` read pipes and files. `losses`, `times` and
`sanity` find lost samples, give each sample its time, and reject impossible data.
"""
