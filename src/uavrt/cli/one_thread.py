"""Imported before numpy: its linear algebra shall use one thread, and the vectors there are."""

import os

from uavrt.blas import blas_environment

os.environ.update(blas_environment())
