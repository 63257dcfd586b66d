"""An archive's tables: writing, checking and querying them."""
