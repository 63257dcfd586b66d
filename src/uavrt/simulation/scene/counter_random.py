"""Random numbers that depend only on (seed, stream, index), not on the order of requests.

Each number is a hash of its stream and index. So a restarted radio program, the process that
computes the true pulses, and a test all see the same world. The hash is the finalizer of
SplitMix64 (Steele, Lea & Flood, OOPSLA 2014), applied twice.
"""

import math
import zlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MULTIPLY_1 = np.uint64(0xBF58476D1CE4E5B9)
_MULTIPLY_2 = np.uint64(0x94D049BB133111EB)


def _mix(value: NDArray[np.uint64]) -> NDArray[np.uint64]:
    value = value ^ (value >> np.uint64(30))
    value = value * _MULTIPLY_1
    value = value ^ (value >> np.uint64(27))
    value = value * _MULTIPLY_2
    return value ^ (value >> np.uint64(31))


def stream_key(seed: int, *names: object) -> int:
    """Key of a random stream for a seed and the stream's name; it is equal in all processes."""
    return zlib.crc32(repr(names).encode()) | ((seed & 0xFFFFFFFF) << 32)


def uniform(key: int, index: ArrayLike) -> NDArray[np.float64]:
    """Uniform random numbers in [0, 1) for an array of indices; indices may be negative."""
    counter = np.atleast_1d(np.asarray(index, dtype=np.int64)).astype(np.uint64)
    # Wrap-around is what the hash wants; NumPy warns of it for scalars only, hence the arrays.
    start = _mix(np.array([key & 0xFFFFFFFFFFFFFFFF], dtype=np.uint64) + _GOLDEN)
    mixed = _mix(_mix(start + counter * _GOLDEN) ^ start)
    result = (mixed >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return result.reshape(np.shape(index))


def normal(key: int, index: ArrayLike) -> NDArray[np.float64]:
    """Standard normal random numbers for an array of indices of a stream (Box & Muller)."""
    indices = np.asarray(index, dtype=np.int64)
    radius = np.sqrt(-2.0 * np.log1p(-uniform(key, 2 * indices)))
    result: NDArray[np.float64] = radius * np.cos(2 * np.pi * uniform(key, 2 * indices + 1))
    return result


def smooth_normal(key: int, position: float) -> float:
    """Smooth random function of `position` with unit variance.

    The values at x and y have the correlation exp(-(x - y)²). The function is a sum of
    independent normal numbers at multiples of 1/2, weighted with a Gaussian of standard
    deviation 1/2 around `position`. It is normalized so that the variance is exactly one.
    """
    halves = 2.0 * position
    knots = np.arange(math.floor(halves) - 4, math.floor(halves) + 6)
    weights = np.exp(-0.5 * (halves - knots) ** 2)
    return float(weights @ normal(key, knots) / np.sqrt(weights @ weights))
