"""Support for Python and its libraries on a small computer: memory, threads, imports."""
