"""Run Python and its libraries on a small computer: memory, threads, imports, kernels."""
