"""Make the flight report for biologists, as one HTML file or one PDF.

`page` and `document` are the two forms, and `words` has their sentences. The others draw:
`maps`, `ground`, `heights`, `roses`, `searches`, `silences`, `times`, `folds`.
"""
