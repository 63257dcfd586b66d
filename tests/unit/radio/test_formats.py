import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from uavrt.core.errors import FormatError
from uavrt.radio.formats import CF32, FORMATS, SampleFormat, clean, sample_format, sigmf_format


@pytest.mark.parametrize("stored", FORMATS.values(), ids=lambda f: f.name)
def test_any_bytes_are_samples_within_full_scale(stored: SampleFormat) -> None:
    raw = np.arange(256, dtype=np.uint8).repeat(stored.bytes_per_sample)
    samples = np.empty(256, np.complex64)
    if stored.in_place:
        return
    stored.convert(raw, samples)
    values = samples.view(np.float32)
    assert np.abs(values).max() <= 1.0
    assert abs(float(values.mean())) < 0.01


@given(hnp.arrays(np.float32, 128, elements=st.floats(-0.9375, 0.9375, width=32)))
def test_a_signal_written_in_any_format_is_read_back_to_its_resolution(
    values: np.ndarray,
) -> None:
    written = {
        "cs16": np.round(values * 32768.0).clip(-32768, 32767).astype("<i2"),
        "cu8": np.round(values * 128.0 + 127.5).clip(0, 255).astype("u1"),
        "ci8": np.round(values * 128.0).clip(-128, 127).astype("i1"),
    }
    for name, stored in written.items():
        back = np.empty(64, np.complex64)
        FORMATS[name].convert(stored.view(np.uint8), back)
        step = 1.0 / FORMATS[name].full_scale
        assert np.abs(back.view(np.float32) - values).max() <= 1.01 * step


def test_an_unknown_format_is_refused_with_a_list_of_the_known() -> None:
    with pytest.raises(FormatError, match="cf32, cs16, cu8, ci8, sigmf, wav"):
        sample_format("mp3")


@pytest.mark.parametrize("datatype", ["rf32_le", "ri16_le", "ru8"])
def test_real_samples_are_refused_as_real(datatype: str) -> None:
    with pytest.raises(FormatError, match="real"):
        sigmf_format(datatype)


def test_big_endian_sigmf_samples_are_read() -> None:
    samples = np.empty(2, np.complex64)
    stored = np.array([16384, -16384, 32767, 0], ">i2")
    sigmf_format("ci16_be").convert(stored.view(np.uint8), samples)
    np.testing.assert_allclose(samples, [0.5 - 0.5j, 1.0], atol=1e-4)


def test_a_few_values_that_are_not_numbers_become_zero_and_are_counted() -> None:
    samples = np.ones(1000, np.complex64)
    samples[10] = complex(np.nan, 1.0)
    samples[20] = complex(1.0, np.inf)
    assert clean(samples, "x") == 2
    assert np.isfinite(samples.view(np.float32)).all()
    assert samples[10] == 1j
    assert clean(samples, "x") == 0


def test_integers_called_floats_are_refused() -> None:
    rng = np.random.default_rng(1)
    integers = rng.integers(-3000, 3000, 4000).astype("<i2")
    with pytest.raises(FormatError, match="format"):
        clean(integers.view(np.complex64).copy(), "x")


def test_random_bytes_called_floats_are_refused() -> None:
    junk = np.frombuffer(np.random.default_rng(1).bytes(80_000), np.complex64).copy()
    # Too few are no numbers for that alone to tell: it is their size.
    assert np.mean(~np.isfinite(junk.view(np.float32))) < 0.008
    with pytest.raises(FormatError, match="far too large"):
        clean(junk, "x")


def test_only_complex64_is_used_in_place() -> None:
    assert CF32.in_place
    assert not any(f.in_place for f in FORMATS.values() if f is not CF32)
    assert not sigmf_format("cf32_be").in_place
