"""Export a flight or an old log to the file formats of other tools.

`written` lists the formats; each other module encodes one of them.
"""
