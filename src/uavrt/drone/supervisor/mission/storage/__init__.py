"""Space and files: free space, copies to a drive, removal of flights."""
