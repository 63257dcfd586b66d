"""Whole flights judged from their kept samples, and the results in words."""
