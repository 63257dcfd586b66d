"""Write, check and query an archive's tables."""
