"""Limit numpy to one thread and choose its instructions; import this before numpy."""

import os

from uavrt.core.runtime.blas import blas_environment

os.environ.update(blas_environment())
