"""The flight report for biologists: one HTML file, one PDF.

`page` and `document` are the two forms, `words` their sentences. The others draw: `maps`,
`ground`, `heights`, `roses`, `searches`, `silences`, `times`, `folds`.
"""
