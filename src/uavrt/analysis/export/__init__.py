"""Export a flight or an old log to the file formats of other tools.

`written` lists the formats; each of the other modules encodes one of them.
"""
