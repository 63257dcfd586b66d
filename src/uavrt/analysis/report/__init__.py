"""Create the flight report for biologists, as one HTML file or one PDF.

`report_blocks` lists the contents; `report_page` and `document` lay them out as HTML and PDF.
`report_words` composes the sentences and tables. The other modules draw: `report_maps`,
`report_ground`, `report_heights`, `roses`, `searches`, `silences`, `report_times`,
`fold_page`.
"""
