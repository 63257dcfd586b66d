"""Operate radios: run their programs and drivers, list USB radios, explain errors."""
