"""Read and write logs of other systems and the original's tools, recognised by `recognise`."""
