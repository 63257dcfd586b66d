"""Transforms of many columns, with SciPy's own module or its documented function."""

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


def test_where_the_module_is_not_found_the_documented_function_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fourier, "EXTENSION_SUFFIXES", [".nothing"])
    fourier.column_transform.cache_clear()
    try:
        values = np.eye(4, dtype=np.complex64)
        assert np.allclose(fourier.transform_columns(values), np.fft.fft(values, axis=0))
    finally:
        fourier.column_transform.cache_clear()
