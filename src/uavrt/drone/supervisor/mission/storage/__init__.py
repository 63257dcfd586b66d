"""Storage of flights: free space, copies to a drive, removal."""
