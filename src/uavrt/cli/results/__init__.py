"""Commands for flights and archives: bearings, positions, reports, exports."""
