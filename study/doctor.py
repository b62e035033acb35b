"""The surroundings of a process, and whether they have what softjaw needs: one line per check, with its cure.

Every check that loads foreign libraries runs in a process of its own: a library that crashes or hangs is a finding.
"""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from subprocess import CompletedProcess

from softjaw.study.messages import CANNOT_WRITE, DONE, USAGE

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
ROOT = Path(__file__).parents[2]  # where the package softjaw lies
# folders with loops that numba compiles
COMPILED = ("fem", "fem/objects", "fem/pad", "fem/shell", "friction", "lsfit", "scoring", "study/case")
PASSING = "softjaw-numba-"  # how temporary folders of compiled loops begin
LAUNCHED = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "HYDRA_")  # variables by which a rank finds the mpirun above it
NOT_IN_TIME = 124  # exit code, as of timeout(1)
NEEDED_SPACE = 1e9  # bytes; the largest shipped study writes about 0.2 GB
SYSTEM_PACKAGES = "python3-petsc4py python3-h5py python3-h5py-mpi python3-mpi4py openmpi-bin"
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
    if os.environ.get("NUMBA_CACHE_DIR") or _writable(_user_cache()):
        return
    if all(_writable(ROOT / "softjaw" / package / "__pycache__") for package in COMPILED):
        return
    folder = tempfile.mkdtemp(prefix=PASSING)
    os.environ["NUMBA_CACHE_DIR"] = folder
    atexit.register(shutil.rmtree, folder, ignore_errors=True)


def compiled_loops_pass() -> bool:
    """Whether compiled loops are kept in a folder that `keep_compiled_loops` made, and no longer than the process."""
    return Path(os.environ.get("NUMBA_CACHE_DIR", "")).name.startswith(PASSING)


def _user_cache() -> Path | None:
    """Where numba keeps a user's compiled loops; None where the user has no home."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "numba"
    except RuntimeError:
        return None


def _writable(folder: Path | None) -> bool:
    """Whether files can be made in a folder, which itself may have to be made first; nothing is made here."""
    if folder is None:
        return False
    # Path.exists would raise where a folder above may not be searched
    existing = next((place for place in (folder, *folder.parents) if os.access(place, os.F_OK)), folder)
    return os.access(existing, os.W_OK | os.X_OK) and existing.is_dir()


def outside_mpi(environment: Mapping[str, str]) -> dict[str, str]:
    """The same variables without those that tie a process to the mpirun it was started by.

    >>> outside_mpi({"HOME": "/root", "OMPI_COMM_WORLD_RANK": "1"})
    {'HOME': '/root'}
    """
    return {name: value for name, value in environment.items() if not name.startswith(LAUNCHED)}


def launch_environment() -> dict[str, str]:
    """Variables for starting mpirun: this process's own, one thread per rank, and leave to run as root if it is root.

    Open MPI refuses root unless two variables allow it; inside a container there is often no other user.
    """
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"} if os.geteuid() == 0 else {}
    return {**dict.fromkeys(THREADS, "1"), **outside_mpi(os.environ), **allowed}


def mpirun(ranks: int) -> list[str]:
    """First words of the command line that starts so many ranks, more than there are cores if need be.

    Raises
    ------
    FileNotFoundError
        There is no ``mpirun`` on the search path.
    """
    command = ["mpirun", "-n", str(ranks)]
    trial = subprocess.run(
        [*command, "true"],
        env=launch_environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=60,
        check=False,
    )
    return command if trial.returncode == 0 else f"mpirun -n {ranks} --oversubscribe".split()


def trouble(answer: CompletedProcess[str]) -> str:
    """Last line of standard error of a program, or how the program ended; code 124: it was not done in time."""
    if answer.returncode == NOT_IN_TIME:
        return "no answer in time"
    lines = [line.strip() for line in answer.stderr.splitlines() if line.strip()]
    return lines[-1] if lines else f"ended with exit code {answer.returncode}"


def ask(code: str, *, prefix: tuple[str, ...] = (), limit: float = 60.0) -> CompletedProcess[str]:
    """Run a piece of Python in a process of its own, behind ``prefix`` (mpirun), for at most ``limit`` seconds."""
    with subprocess.Popen(
        [*prefix, sys.executable, "-c", code],
        env={**launch_environment(), "H5PY_ALWAYS_USE_MPI": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as process:
        try:
            output, errors = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            process.terminate()  # mpirun ends its ranks when asked to, not when killed
            try:
                process.communicate(timeout=10.0)
            except subprocess.TimeoutExpired:
                process.kill()
            return CompletedProcess(process.args, NOT_IN_TIME, "", "")
    return CompletedProcess(process.args, process.returncode, output.strip(), errors)


# --- checks -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Finding:
    """What one check found; ``cure`` is empty when all is well, ``code`` is the exit code that a trouble deserves."""

    text: str
    cure: str = ""
    code: int = USAGE

    @property
    def line(self) -> str:
        """The finding and its cure as one line."""
        return f"{self.text}; cure: {self.cure}" if self.cure else self.text


def check_python() -> Finding:
    """Which Python this is; pip has refused one that is too old."""
    return Finding(f"{sys.version.split()[0]} at {sys.executable}")


def check_packages() -> Finding:
    """The packages that pip brings import."""
    names = "numpy scipy skfem numba clarabel pydantic matplotlib"
    answer = ask(f"import {names.replace(' ', ', ')}; print('scipy', scipy.__version__, 'numba', numba.__version__)")
    if answer.returncode != 0:
        return Finding(trouble(answer), "run 'make setup', or: .venv/bin/pip install -e .")
    return Finding(answer.stdout)


def check_numpy() -> Finding:
    """The compiled system packages were built for the numpy that is imported."""
    answer = ask("import numpy; print(numpy.__version__); import h5py; from softjaw.fem.petsc import PETSc")
    version = answer.stdout or "not importable"
    if "dtype size changed" in answer.stderr or "compiled using NumPy 1" in answer.stderr:
        older = "numpy>=1.26,<2" if version.startswith("2") else "numpy>=2"
        return Finding(f"{version} does not fit the system's h5py and petsc4py", f".venv/bin/pip install '{older}'")
    if not answer.stdout:
        return Finding(f"numpy: {trouble(answer)}", ".venv/bin/pip install -e .")
    return Finding(f"{version}, fits h5py and petsc4py" if answer.returncode == 0 else version)


SADDLE = """
import numpy as np
from softjaw.fem.petsc import PETSc
assert PETSc.ScalarType is np.float64, "PETSc was built with complex scalars"
K = PETSc.Mat().createDense([3, 3], array=np.array([[2.0, 0, 1], [0, 2, 1], [1, 1, 0]]), comm=PETSc.COMM_SELF)
K = K.convert("aij")
b, x = K.createVecLeft(), K.createVecRight()
b.setArray([5.0, 7.0, 3.0])
ksp = PETSc.KSP().create(PETSc.COMM_SELF)
ksp.setOperators(K)
ksp.setType("preonly")
ksp.getPC().setType("lu")
ksp.getPC().setFactorSolverType("mumps")
ksp.solve(b, x)
assert np.allclose(x.getArray(), [1.0, 2.0, 3.0]), f"MUMPS gave {x.getArray()} for (1, 2, 3)"
print(".".join(map(str, PETSc.Sys.getVersion())), "with real scalars; MUMPS solves a saddle-point system")
"""


def check_petsc() -> Finding:
    """petsc4py is found, has real scalars, and MUMPS factorises a matrix with a zero on its diagonal."""
    answer = ask(SADDLE)
    if answer.returncode == 0:
        return Finding(answer.stdout)
    if "complex scalars" in answer.stderr:
        return Finding(trouble(answer), "apt-get install python3-petsc4py-real and unset PETSC_DIR and PETSC_ARCH")
    if "MUMPS" in answer.stderr or "mumps" in answer.stderr:
        return Finding(trouble(answer), "use a PETSc that was configured with MUMPS; Debian's and conda-forge's are")
    return Finding(trouble(answer), INSTALL)


def check_blas() -> Finding:
    """The BLAS beneath PETSc is an optimised one; only Debian's way of choosing it is looked at."""
    link = Path("/etc/alternatives").glob("libblas.so.3-*")
    chosen = next((str(path.resolve()) for path in link), "")
    if "/blas/libblas" in chosen:
        text = "the reference BLAS makes factorisations four times slower"
        return Finding(text, "apt-get install libopenblas0-serial")
    return Finding(Path(chosen).parent.name if chosen else "not chosen by Debian's alternatives")


def check_h5py() -> Finding:
    """The h5py that ranks load has parallel HDF5 beneath it."""
    answer = ask(
        "import h5py, sys; c = h5py.get_config(); v = h5py.version;"
        "print(int(c.mpi), int(h5py.__file__.startswith(sys.prefix)), v.version, 'on HDF5', v.hdf5_version)"
    )
    if answer.returncode != 0:
        return Finding(trouble(answer), INSTALL)
    parallel, bundled, version = answer.stdout.split(" ", 2)
    if parallel == "1":
        return Finding(f"{version} with MPI")
    cure = ".venv/bin/pip uninstall h5py (that build hides the system's)" if bundled == "1" else INSTALL
    return Finding(f"{version} without MPI", cure)


def check_mpi() -> Finding:
    """Two ranks start, find each other and write one file together."""
    if shutil.which("mpirun") is None:
        return Finding("mpirun is not on the search path", INSTALL)
    with tempfile.TemporaryDirectory() as folder:
        code = (
            "from mpi4py import MPI; import h5py; comm = MPI.COMM_WORLD\n"
            "if comm.size == 1: raise SystemExit('every rank is alone')\n"
            f"with h5py.File({folder + '/ranks.hdf'!r}, 'w', driver='mpio', comm=comm) as f:\n"
            "    f.create_dataset('rank', (comm.size,), 'i8')[comm.rank] = comm.rank + 1\n"
            "comm.Barrier()\n"
            f"with h5py.File({folder + '/ranks.hdf'!r}, driver='mpio', comm=comm) as f: total = f['rank'][:].sum()\n"
            "if comm.rank == 0: print(total, MPI.Get_library_version().split(',')[0].split(chr(10))[0])"
        )
        answer = ask(code, prefix=tuple(mpirun(2)), limit=90.0)
    if "every rank is alone" in answer.stderr:
        return Finding("mpirun and mpi4py belong to different MPI libraries", "put mpi4py's own mpirun first in PATH")
    if answer.returncode != 0:
        return Finding(f"two ranks: {trouble(answer)}", f"see whether 'mpirun -n 2 true' works; {INSTALL}")
    total, library = answer.stdout.splitlines()[-1].split(" ", 1)
    if total != "3":
        return Finding("two ranks lost data in one file", f"set TMPDIR to a disk with MPI-IO, {folder} has none")
    return Finding(f"{library}, two ranks write one file")


def check_threads() -> Finding:
    """One thread per rank."""
    wrong = [f"{name}={os.environ[name]}" for name in THREADS if os.environ.get(name, "1") != "1"]
    if wrong:
        text = f"{', '.join(wrong)}: ranks slow each other, and last digits depend on the number"
        return Finding(text, "export OMP_NUM_THREADS=1")
    return Finding("one per rank")


DRAWING = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere(), color="red")
picture = plotter.screenshot(None, return_img=True)
assert picture.std() > 1, "the picture is empty"
print("pyvista", pyvista.__version__, "through", plotter.render_window.GetClassName())
"""


def check_pictures() -> Finding:
    """A sphere is drawn without a screen; a missing OpenGL library ends the process that tries."""
    answer = ask(DRAWING)
    if answer.returncode == 0:
        return Finding(answer.stdout.splitlines()[-1])
    return Finding(f"no 3-D pictures: {trouble(answer)}", "apt-get install libosmesa6 (or libegl1 libegl-mesa0)")


def check_cache() -> Finding:
    """Compiled loops can be kept from one start to the next."""
    wanted = os.environ.get("NUMBA_CACHE_DIR")
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for folder in [Path(wanted)] if wanted else [Path(__file__).parent.parent / "fem", home]:
        if can_write(folder) and not compiled_loops_pass():
            return Finding(f"compiled loops are kept in {folder}")
    cure = "export NUMBA_CACHE_DIR=<a folder you may write to>"
    return Finding("compiled loops cannot be kept, every start compiles anew", cure, CANNOT_WRITE)


def check_disk() -> Finding:
    """Results can be written here, and there is room for them."""
    here = Path.cwd()
    if not can_write(here):
        return Finding(f"{here} is not writable", "start softjaw in a folder of your own", CANNOT_WRITE)
    free = shutil.disk_usage(here).free
    if free < NEEDED_SPACE:
        text = f"{free / 1e9:.1f} GB free in {here}"
        return Finding(text, f"free at least {NEEDED_SPACE / 1e9:.0f} GB", CANNOT_WRITE)
    return Finding(f"{free / 1e9:.0f} GB free in {here}")


def can_write(folder: Path) -> bool:
    """Whether a file can be made in this folder, which is made if it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


CHECKS: dict[str, Callable[[], Finding]] = {
    "python": check_python,
    "packages": check_packages,
    "numpy": check_numpy,
    "petsc": check_petsc,
    "blas": check_blas,
    "h5py": check_h5py,
    "mpi": check_mpi,
    "threads": check_threads,
    "pictures": check_pictures,
    "cache": check_cache,
    "disk": check_disk,
}


def doctor(_options: Namespace | None = None) -> int:
    """Print one line per check; 0 when all is well, 2 when something is missing, 5 when only writing fails."""
    codes = []
    for name, check in CHECKS.items():
        try:
            finding = check()
        except Exception as error:  # a check that fails itself must not hide the ones after it
            finding = Finding(f"{type(error).__name__}: {error}", "report this line; it is a bug of the doctor's")
        print(f"{'TROUBLE' if finding.cure else 'fine':8}{name:10}{finding.line}", flush=True)
        codes.append(finding.code if finding.cure else DONE)
    return USAGE if USAGE in codes else max(codes)
