"""Limit numpy's linear algebra to one thread, and select its vector instructions.

Must be imported before numpy.
"""

import os

from uavrt.core.runtime.blas import blas_environment

os.environ.update(blas_environment())
