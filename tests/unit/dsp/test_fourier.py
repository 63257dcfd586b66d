"""Transforms of many columns, with SciPy's own module or its documented function."""

from collections.abc import Iterator
from importlib.util import spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from uavrt.dsp import fourier


@pytest.mark.parametrize("make", [fourier.column_transform, fourier.public_transform])
def test_each_column_is_transformed(make: object) -> None:
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((37, 200)).astype(np.float32).view(np.complex64)
    ours = make()(rows.T)  # type: ignore[operator]
    assert ours.dtype == np.complex64
    assert np.allclose(ours, np.fft.fft(rows.T.astype(np.complex128), axis=0), atol=2e-5)


@pytest.fixture
def fresh() -> Iterator[None]:
    """Let the transform be chosen again, before and after the test."""
    fourier.column_transform.cache_clear()
    yield
    fourier.column_transform.cache_clear()


@pytest.mark.usefixtures("fresh")
def test_where_the_module_is_not_found_the_documented_function_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fourier, "EXTENSION_SUFFIXES", [".nothing"])
    values = np.eye(4, dtype=np.complex64)
    assert np.allclose(fourier.transform_columns(values), np.fft.fft(values, axis=0))


@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize("does", ["raise ValueError('no place is taken')", "return out * 0"])
def test_a_module_that_takes_a_place_for_the_result_otherwise_is_not_used(
    does: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "changed.py"
    path.write_text(
        "import numpy\n"
        "def c2c(values, axes, forward, norm, out, workers):\n"
        f"    if out is not None: {does}\n"
        "    return numpy.fft.fft(values, axis=0).astype(values.dtype)\n"
    )
    monkeypatch.setattr(fourier, "_extension", lambda: spec_from_file_location("changed", path))
    rows = np.eye(4, dtype=np.complex64)
    ours = fourier.transform_columns(rows.T, np.empty((4, 4), np.complex64).T)
    assert np.allclose(ours, np.fft.fft(rows.T, axis=0))
