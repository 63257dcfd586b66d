"""Make the flight report for biologists, as one HTML file or one PDF.

`report_page` and `document` are the two forms, and `report_words` has their sentences. The
other modules draw: `report_maps`, `report_ground`, `report_heights`, `roses`, `searches`,
`silences`, `report_times`, `fold_page`.
"""
