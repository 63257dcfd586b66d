"""Where samples come from: radio programs, pipes and files behind one interface.

`source` is the interface, `opening` chooses a source. `programs` starts a radio's program,
`soapy` its driver, `stream`, `wav` and `sigmf` read pipes and files; `losses`, `times` and
`sanity` say what is missing, when it was, and whether it can be true.
"""
