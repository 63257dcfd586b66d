"""Effect of the ray that level ground reflects on a tag's level, if its strength is unknown.

The reflected ray interferes with the direct one. The sum depends on the height of the tag, on
the roughness of the ground, and on the elevation of the drone. Height and roughness of an
animal's place are unknown. Over all of them, the part that neither the tag's strength nor its
path loss exponent explains is nearly a mean plus two functions of the elevation with
independent normal coefficients (principal components). So a level is linear in these unknowns,
too, and they need no hypotheses of their own.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.tuning import REFLECTION

_Floats = NDArray[np.floating[Any]]


def two_ray_gain_db(sine: _Floats, height: _Floats | float, share: _Floats | float) -> _Floats:
    """Level of direct and reflected ray over that of the direct ray alone [dB].

    Horizontal waves, received far above the tag. `sine`: of the drone's elevation. `height`:
    of the tag above the ground [wavelengths]. `share`: of the reflected amplitude that remains
    on rough ground.
    """
    root = np.sqrt(REFLECTION.permittivity - (1.0 - sine**2))
    phase = 4.0 * np.pi * height * sine
    both = np.abs(1.0 + share * (sine - root) / (sine + root) * np.exp(-1j * phase))
    return np.asarray(20.0 * np.log10(np.maximum(both, REFLECTION.least_sum)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReflectionShapes:
    """Mean and principal components of an unknown reflection, by the drone's elevation."""

    table: NDArray[np.float32]
    """(1 + components, steps) levels over even steps of the elevation's sine, 0 to 1 [dB]."""

    @property
    def components(self) -> int:
        """Number of principal components."""
        return len(self.table) - 1

    def at(self, sine: _Floats) -> list[_Floats]:
        """Mean and components at elevations, given by their sines [dB]."""
        place = (sine * float(self.table.shape[1] - 1) + 0.5).astype(np.int32)
        return [row[place] for row in self.table]


@lru_cache(maxsize=1)
def reflection_shapes() -> ReflectionShapes:
    """Mean and principal components of the reflection over all heights and shares.

    Every distance within `REFLECTION.least_sine` counts the same on a logarithmic scale. The
    drone's memory is small: matrices are multiplied without the buffers of BLAS and LAPACK.
    """
    sine = np.linspace(0.0, 1.0, REFLECTION.steps)
    used = np.maximum(sine, REFLECTION.least_sine)
    gain = np.array(
        [
            two_ray_gain_db(used, height, share)
            for height in np.linspace(*REFLECTION.heights)
            for share in REFLECTION.shares
        ]
    )
    weight = (sine >= REFLECTION.least_sine) / used
    # Strength and exponent of the tag, which are unknown as well, explain a straight line.
    fall = np.log10(used)
    fall -= np.average(fall, weights=weight)
    slope = np.einsum("ns,s->n", gain, weight * fall) / float((weight * fall**2).sum())
    rest = gain - np.average(gain, axis=1, weights=weight)[:, None] - slope[:, None] * fall
    mean = rest.mean(axis=0)
    rest -= mean
    scores = _leading_vectors(
        np.einsum("ns,ms,s->nm", rest, rest, weight), REFLECTION.components
    )
    shapes = np.einsum("nc,ns->cs", scores, rest) / np.sqrt(len(rest))
    return ReflectionShapes(table=np.vstack([mean, shapes]).astype(np.float32))


def _leading_vectors(matrix: _Floats, count: int) -> _Floats:
    """Compute a covariance's leading eigenvectors by power iteration, shape (n, count)."""
    found = []
    for _ in range(count):
        vector = matrix[:, np.argmax(matrix.diagonal())]
        for _ in range(REFLECTION.rounds):
            vector = np.einsum("nm,m->n", matrix, vector)
            vector = vector / np.sqrt((vector**2).sum())
        value = float(np.einsum("n,nm,m->", vector, matrix, vector))
        matrix = matrix - value * vector[:, None] * vector
        found.append(vector)
    return np.stack(found, axis=1)
