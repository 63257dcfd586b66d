"""The tunnel's wire formats: one file per message."""
