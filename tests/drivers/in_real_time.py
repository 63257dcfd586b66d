"""Tests that judge samples by the time of their arrival."""

import pytest

in_real_time = pytest.mark.flaky(reruns=2)
"""A computer that stands still for 0.2 s looks like a radio that has lost samples: the test is
tried again, and the summary of the run names it. What always fails fails three times."""
