"""Which kernels of OpenBLAS this CPU can run, and which are in use.

OpenBLAS chooses its kernel by the CPU, and sums then end in other bits. The environment variable OPENBLAS_CORETYPE
asks for another kernel; it reaches every copy: numpy's, scipy's and the system's that PETSc and MUMPS call.
"""

import ctypes
import importlib
from pathlib import Path

NEEDS = {"Nehalem": {"sse4_2"}, "Haswell": {"avx2", "fma"}, "Zen": {"avx2", "fma"},
         "SkylakeX": {"avx512f", "avx512dq", "avx512bw", "avx512vl"}}  # fmt: skip
# Builds of OpenBLAS without a kernel run that of an older CPU instead; scipy's has none for Zen.
STANDS_IN = {"Zen": "Haswell"}
NAMES = [f"{prefix}openblas_get_corename{suffix}" for prefix in ("", "scipy_") for suffix in ("", "64_")]


def usable() -> list[str]:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return []
    flags = {flag for line in lines if line.startswith("flags") for flag in line.split()}
    return [kernel for kernel, needs in NEEDS.items() if needs <= flags]


def loaded() -> dict[str, str]:
    for name in ("numpy", "scipy.linalg", "softjaw.fem.petsc"):
        importlib.import_module(name)
    files = {line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if "openblas" in line}
    kernels = {}
    for file in sorted(files):
        library = ctypes.CDLL(file)
        if name := next((name for name in NAMES if hasattr(library, name)), ""):
            corename = getattr(library, name)
            corename.restype = ctypes.c_char_p
            kernels[file] = corename().decode()
    return kernels


if __name__ == "__main__":  # for the Makefile
    print(*usable())
