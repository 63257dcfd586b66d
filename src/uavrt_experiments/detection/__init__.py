"""What the detector can do, measured: signals, trials, and the tables of the claims."""
