"""Output of commands: JSON, progress, text for terminals."""
