"""Samples from recordings: raw files, SigMF and WAV."""
