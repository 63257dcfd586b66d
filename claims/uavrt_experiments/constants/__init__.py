"""Screening of localization's constants: which of them change a result."""
