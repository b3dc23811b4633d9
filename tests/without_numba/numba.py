"""In numba's place for the tests' tiny frames, which take less time than its kernels take to compile."""

raise ImportError("left out by the tests")
