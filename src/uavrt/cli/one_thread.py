"""Import before numpy: limits its linear algebra to one thread, and selects its vector
instructions.
"""

import os

from uavrt.blas import blas_environment

os.environ.update(blas_environment())
