"""Flight directories, pulse logs and recordings: writers and readers together."""
