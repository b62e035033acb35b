"""The surroundings of a process, and whether they have what softjaw needs: one line per check, with its cure.

Every check that loads foreign libraries runs in a process of its own: a library that crashes or hangs is a finding.
"""

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable
from functools import partial
from pathlib import Path
from subprocess import CompletedProcess

from softjaw.study.messages import CANNOT_WRITE, DONE, USAGE, launched

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
ROOT = Path(__file__).parents[2]  # where the package softjaw lies
# folders with loops that numba compiles
COMPILED = ("fem", "fem/objects", "fem/shell", "friction", "scoring", "study/case")
PASSING = "softjaw-numba-"  # how temporary folders of compiled loops begin
LAUNCHED = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "HYDRA_")  # variables by which a rank finds the mpirun above it
# Open MPI then looks for no network. As isolated singletons processes would share one folder, which each removes.
ALONE = {"OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self"}
ALLOWED = {"OMPI_MCA_rmaps_base_oversubscribe": "1", "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}
AS_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
NOT_IN_TIME = 124  # exit code of timeout(1)
NEEDED_SPACE = 1e9  # bytes; the largest shipped study writes about 0.2 GB
SYSTEM_PACKAGES = "python3-petsc4py python3-h5py python3-h5py-mpi python3-mpi4py openmpi-bin"
USE_MUMPS = "use a PETSc that was configured with MUMPS; Debian's and conda-forge's are"
INSTALL = f"run 'make setup', or: apt-get install --no-install-recommends {SYSTEM_PACKAGES}"


def pin_threads() -> None:
    """Give every rank one thread unless the user says otherwise; has to run before numpy is imported.

    Ranks share the cores already, and the order of a sum, so its last bits, depends on the number of threads.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")


def keep_compiled_loops() -> None:
    """Let numba keep compiled loops in a private temporary folder when it could not write anywhere else.

    Without any place to write it refuses to compile at all. Has to run before numba is imported. The folder is removed
    at the end of the process, so every start compiles anew: what is loaded from it is code, which nobody else may have
    put there.
    """
    home = os.environ.get("XDG_CACHE_HOME") or str(Path(os.path.expanduser("~")) / ".cache")  # noqa: PTH111
    if os.environ.get("NUMBA_CACHE_DIR") or _writable(Path(home) / "numba"):
        return
    if all(_writable(ROOT / "softjaw" / package / "__pycache__") for package in COMPILED):
        return
    folder = tempfile.mkdtemp(prefix=PASSING)
    os.environ["NUMBA_CACHE_DIR"] = folder
    atexit.register(shutil.rmtree, folder, ignore_errors=True)


def begin_mpi() -> None:
    """Begin MPI before others do: of a process that is alone in a quarter of a second less."""
    if not launched() and not ALONE.keys() & os.environ.keys():
        os.environ |= ALONE
        import mpi4py.MPI  # noqa: F401

        for name in ALONE:  # programs that this one starts may have ranks
            del os.environ[name]


def _writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which itself may have to be made first; nothing is made here."""
    # Path.exists would raise where a folder above may not be searched
    existing = next((place for place in (folder, *folder.parents) if os.access(place, os.F_OK)), folder)
    return os.access(existing, os.W_OK | os.X_OK) and existing.is_dir()


def launch_environment() -> dict[str, str]:
    """Variables for starting mpirun: this process's own, one thread per rank, and leave for what Open MPI refuses.

    That is more ranks than cores, and root: inside a container there is often no other user.
    """
    outside_mpi = {name: value for name, value in os.environ.items() if not name.startswith(LAUNCHED)}
    return {**dict.fromkeys(THREADS, "1"), **outside_mpi, **ALLOWED, **({} if os.geteuid() else AS_ROOT)}


def trouble(answer: CompletedProcess[str]) -> str:
    """Last line of standard error of a program, or how the program ended; code 124: it was not done in time."""
    if answer.returncode == NOT_IN_TIME:
        return "no answer in time"
    lines = [line.strip() for line in answer.stderr.splitlines() if line.strip()]
    return lines[-1] if lines else f"ended with exit code {answer.returncode}"


def ask(code: str, *, prefix: tuple[str, ...] = (), limit: float = 60.0) -> CompletedProcess[str]:
    """Run a piece of Python in a process of its own, behind ``prefix`` (mpirun), for at most ``limit`` seconds."""
    # timeout(1), because mpirun ends its ranks when it is asked to, not when it is killed
    return subprocess.run(
        ["timeout", "--kill-after=10", str(limit), *prefix, sys.executable, "-c", code],
        env={**launch_environment(), "H5PY_ALWAYS_USE_MPI": "1"}, stdin=subprocess.DEVNULL, capture_output=True,
        text=True, cwd=ROOT, check=False,
    )  # fmt: skip


# --- checks -----------------------------------------------------------------------------------------------------------


SADDLE = """
import numpy as np; from scipy.sparse import csr_matrix; from softjaw.fem.petsc import PETSc, Factors
assert PETSc.ScalarType is np.float64, "PETSc was built with complex scalars"
rows, columns = np.indices((3, 3), "i4").reshape(2, -1)
K = csr_matrix((np.array([2.0, 0, 1, 0, 2, 1, 1, 1, 0]), (rows, columns)))
x = Factors(K).solve(np.array([5.0, 7.0, 3.0]))
assert np.allclose(x, [1.0, 2.0, 3.0]), f"MUMPS gave {x} for (1, 2, 3)"
print(".".join(map(str, PETSc.Sys.getVersion())), "with real scalars; MUMPS solves a saddle-point system")
"""
PARALLEL = """
import h5py, sys
text = f"{h5py.version.version} on HDF5 {h5py.version.hdf5_version}"
bundled = " (of pip)" if h5py.__file__.startswith(sys.prefix) else ""
print(text, "with MPI") if h5py.get_config().mpi else sys.exit(f"{text} without MPI{bundled}")
"""
TOGETHER = """
from mpi4py import MPI; import h5py, os, tempfile
comm = MPI.COMM_WORLD
assert comm.size == 2, "every rank is alone"
path = comm.bcast(tempfile.mktemp(".hdf"))
with h5py.File(path, "w", driver="mpio", comm=comm) as f: f.create_dataset("rank", (2,), "i8")[comm.rank] = comm.rank
comm.Barrier()
with h5py.File(path, driver="mpio", comm=comm) as f: assert f["rank"][:].sum() == 1, "two ranks lost data in one file"
comm.Barrier()
if comm.rank == 0: os.remove(path); print(*MPI.get_vendor(), "two ranks write one file")
"""
DRAWING = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere(), color="red")
picture = plotter.screenshot(None, return_img=True)
assert picture.std() > 1, "the picture is empty"
print("pyvista", pyvista.__version__, "through", plotter.render_window.GetClassName())
"""
# What is run, and for what its errors hold the cure; the last one is for all other errors.
PROBES: dict[str, tuple[str, dict[str, str]]] = {
    "packages": ("import sys, scipy, skfem, numba, clarabel, pydantic, matplotlib; print('python', *sys.version.split()"
                 "[:1], 'scipy', scipy.__version__, 'numba', numba.__version__)",
                 {"": "run 'make setup', or: .venv/bin/pip install -e ."}),
    "numpy": ("import numpy, h5py; from softjaw.fem.petsc import PETSc;"
              "print(numpy.__version__, 'fits h5py and petsc4py')",
              {"dtype size changed": "take the numpy that the system's h5py and petsc4py were built with:"
               " .venv/bin/pip install 'numpy>=1.26,<2', or 'numpy>=2'", "": ".venv/bin/pip install -e ."}),
    "petsc": (SADDLE, {"complex scalars": "apt-get install python3-petsc4py-real; unset PETSC_DIR PETSC_ARCH",
                       "MUMPS": USE_MUMPS, "mumps": USE_MUMPS, "": INSTALL}),
    "h5py": (PARALLEL, {"(of pip)": ".venv/bin/pip uninstall h5py (it hides the system's)", "": INSTALL}),
    "mpi": (TOGETHER, {"every rank is alone": "put the mpirun of mpi4py's own MPI library first in PATH",
                       "lost data": "set TMPDIR to a disk with MPI-IO",
                       "": f"see whether 'mpirun -n 2 true' works; {INSTALL}"}),
    "pictures": (DRAWING, {"": "apt-get install libosmesa6 (or libegl1 libegl-mesa0)"}),
}  # fmt: skip
Finding = tuple[str, str, int]  # what a check found; its cure, empty when all is well; the exit code of a trouble


def probed(name: str) -> Finding:
    """What a probe prints last, or its error with the cure of it."""
    code, cures = PROBES[name]
    answer = ask(code, prefix=("mpirun", "-n", "2") if name == "mpi" else (), limit=90.0)
    if answer.returncode == 0:
        return answer.stdout.splitlines()[-1], "", DONE
    mark = next(mark for mark in cures if mark in answer.stderr)
    # Below an error of several ranks stands what mpirun says of it.
    line = next((line for line in answer.stderr.splitlines() if mark and mark in line), trouble(answer))
    return line.strip(), cures[mark], USAGE


def check_speed() -> Finding:
    """One thread per rank, an optimised BLAS beneath PETSc (as Debian chooses it), and compiled loops that are kept."""
    slow = {f"export {name}=1": f"{name}={os.environ.get(name)}: threads slow other ranks" for name in THREADS
            if os.environ.get(name, "1") != "1"}  # fmt: skip
    if any("/blas/libblas" in str(path.resolve()) for path in Path("/etc/alternatives").glob("libblas.so.3-*")):
        slow["apt-get install libopenblas0-serial"] = "this BLAS makes factorisations four times slower"
    folder = Path(os.environ.get("NUMBA_CACHE_DIR", tempfile.gettempdir()))
    if folder.name.startswith(PASSING) or not _writable(folder):
        slow["export NUMBA_CACHE_DIR=<a folder you may write to>"] = "every start compiles anew"
    return "; ".join(slow.values()) or "one thread per rank, fast BLAS, kept loops", "; ".join(slow), USAGE * bool(slow)


def check_disk() -> Finding:
    """Results can be written here, and there is room for them."""
    folder = Path.cwd()
    if not _writable(folder):
        return f"{folder} is not writable", "start softjaw in a folder of your own", CANNOT_WRITE
    free = shutil.disk_usage(folder).free
    cure = f"free at least {NEEDED_SPACE / 1e9:.0f} GB" if free < NEEDED_SPACE else ""
    return f"{free / 1e9:.1f} GB free in {folder}", cure, CANNOT_WRITE if cure else DONE


CHECKS: dict[str, Callable[[], Finding]] = {name: partial(probed, name) for name in PROBES}
CHECKS |= {"speed": check_speed, "disk": check_disk}


def doctor(_options: Namespace | None = None) -> int:
    """Print one line per check; 0 when all is well, 2 when something is missing, 5 when only writing fails."""
    codes = []
    for name, check in CHECKS.items():
        try:
            text, cure, code = check()
        except Exception as error:  # a check that fails itself must not hide the ones after it
            text, cure, code = f"{type(error).__name__}: {error}", "report this line; it is a bug", USAGE
        print(f"{'TROUBLE' if cure else 'fine':8}{name:10}{text}{'; cure: ' * bool(cure)}{cure}", flush=True)
        codes.append(code)
    return USAGE if USAGE in codes else max(codes)
