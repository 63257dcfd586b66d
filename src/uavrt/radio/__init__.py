"""Where samples come from: radio programs, pipes and files behind one interface.

`source` is the interface, `opening` chooses a source. `airspy`, `airspyhf`, `hackrf`, `rtlsdr`
and `soapy` are radios, `stream`, `wav` and `sigmf` pipes and files; `losses`, `times` and
`sanity` say what is missing, when it was, and whether it can be true.
"""
