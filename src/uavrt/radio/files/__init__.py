"""Read samples from recordings: raw files, SigMF and WAV."""
