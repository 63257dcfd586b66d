"""Parts of the recorder: times of commits, choice of health reports, missing poses."""
