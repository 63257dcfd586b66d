"""Export a flight or an old log to the file formats of other tools.

`written` is the table of formats; each other module makes the bytes of one.
"""
