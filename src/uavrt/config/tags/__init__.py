"""Tag lists: files in all formats, and plausibility checks of their values."""
