"""What NumPy's linear algebra is told before it is loaded."""

from pathlib import Path

from uavrt.core.runtime.blas import blas_environment

WIDE = "processor : 0\nflags\t\t: fpu sse2 avx2 avx512f avx512cd avx512bw avx512dq avx512vl\n"


def test_a_processor_with_wide_vectors_gets_the_kernels_for_them(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(WIDE)
    assert blas_environment({}, cpuinfo)["OPENBLAS_CORETYPE"] == "SkylakeX"


def test_a_processor_that_lacks_an_instruction_is_left_to_openblas(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    for missing in ("avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"):
        cpuinfo.write_text(WIDE.replace(f" {missing}", ""))
        assert "OPENBLAS_CORETYPE" not in blas_environment({}, cpuinfo)
    assert "OPENBLAS_CORETYPE" not in blas_environment({}, tmp_path / "none")


def test_what_the_environment_says_stands(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(WIDE)
    given = {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "2"}
    assert not given.keys() & blas_environment(given, cpuinfo).keys()
