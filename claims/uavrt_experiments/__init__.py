"""Repeatable experiments for published claims."""
