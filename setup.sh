#!/usr/bin/env bash
# Set softjaw up: system packages, the virtual environment .venv, and softjaw in it. Safe to run again: when nothing has
# changed since the last time it only checks that everything imports. Started by every target of the Makefile.
#
#   PYTHON=/path/to/python3 ./setup.sh     another interpreter than /usr/bin/python3 (one that sees petsc4py and h5py)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

packages=(python3 python3-venv python3-petsc4py python3-h5py python3-h5py-mpi python3-mpi4py openmpi-bin)
venv=.venv
stamp=$venv/set-up-of-softjaw
export OMP_NUM_THREADS=1
PATH=$PATH:/usr/sbin:/sbin # ldconfig, on Debian out of an ordinary user's way

say() { printf 'set-up: %s\n' "$*"; }
fail() { printf 'set-up: %s\n' "$@" >&2; exit 1; }

# What a Python lacks of the parts that must come from the system because they share one MPI library; empty when none.
lacks() {
    command -v "$1" > /dev/null || { echo "$1"; return; }
    "$1" - <<'PROBE' 2>&1 || echo "a Python that runs"
import glob, importlib.util, os, sys

os.environ["H5PY_ALWAYS_USE_MPI"] = "1"
missing = []
if sys.version_info < (3, 11):
    missing.append(f"Python 3.11 or newer (found {sys.version.split()[0]}; Debian 12 and Ubuntu 24.04 have it)")
# Debian's petsc4py lies outside the search path; fem/petsc.py looks there too.
folders = glob.glob("/usr/lib/petscdir/petsc3*/*-real/lib/python3/dist-packages")
sys.path += [folder for folder in folders if os.path.isdir(os.path.join(folder, "petsc4py"))]
for module in ("venv", "ensurepip", "petsc4py", "mpi4py"):
    if importlib.util.find_spec(module) is None:
        missing.append(module)
try:
    import h5py

    if not h5py.get_config().mpi:
        missing.append("h5py with parallel HDF5")
except Exception:
    missing.append("h5py with parallel HDF5")
print(", ".join(missing))
PROBE
    command -v mpirun > /dev/null || echo "mpirun"
}

# The libraries that draw pictures without a screen: OSMesa, or EGL where a release no longer has OSMesa.
has_renderer() { ldconfig -p 2> /dev/null | grep -qE 'libOSMesa\.so\.8|libEGL_(mesa|nvidia)\.so'; }

renderer() {
    has_renderer && return
    if apt-cache show libosmesa6 > /dev/null 2>&1; then echo libosmesa6; else printf '%s\n' libegl1 libegl-mesa0; fi
}

# MUMPS spends its time in BLAS. The reference implementation is four to five times slower than OpenBLAS; the serial build
# is the right one for one thread per rank.
slow_blas() {
    case $(readlink -f "$(ldconfig -p 2> /dev/null | awk '/libblas\.so\.3 / { print $NF; exit }')") in
        */blas/libblas.so.3*) return 0 ;;
    esac
    return 1
}

as_root() {
    if [ "$(id -u)" = 0 ]; then env DEBIAN_FRONTEND=noninteractive "$@"; else sudo env DEBIAN_FRONTEND=noninteractive "$@"; fi
}

may_install() {
    command -v apt-get > /dev/null || return 1
    [ "$(id -u)" = 0 ] && return
    command -v sudo > /dev/null || return 1
    sudo -n true 2> /dev/null || [ -t 0 ]
}

other_ways() {
    if [ "$python" != /usr/bin/python3 ]; then
        fail "$python does not see: $1" "without PYTHON= the system's Python is used, and apt-get can install what is missing"
    fi
    fail "not found: $1" \
        "they cannot be installed from here (that takes apt-get, and root or sudo). Either ask an administrator for" \
        "    apt-get install --no-install-recommends ${packages[*]} libosmesa6 libopenblas0-serial" \
        "or, without any rights, make and activate an environment with conda-forge's builds (PETSc with MUMPS, HDF5 with MPI):" \
        "    conda env create -f environment.yml" \
        "    conda activate softjaw && make PYTHON=python3 setup"
}

install_system_packages() {
    local wanted=("${packages[@]}")
    say "not found: $1"
    say "refreshing the package lists"
    as_root apt-get update -qq || say "the package lists could not be refreshed; trying with those that are here"
    mapfile -t -O "${#wanted[@]}" wanted < <(renderer)
    # before the other packages are there it is not known which BLAS they bring; a second one does no harm
    wanted+=(libopenblas0-serial)
    say "installing with apt-get: ${wanted[*]}"
    as_root apt-get install -qq -y --no-install-recommends -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=300 "${wanted[@]}" > /dev/null \
        || fail "apt-get could not install these packages; see its message above"
}

# Everything below imports what it names, in the environment itself.
venv_works() {
    [ -x $venv/bin/softjaw ] && $venv/bin/python - <<'PROBE' > /dev/null 2>&1
import glob, os, sys

os.environ["H5PY_ALWAYS_USE_MPI"] = "1"
sys.path += sorted(glob.glob("/usr/lib/petscdir/petsc3*/*-real/lib/python3/dist-packages"))
import clarabel, h5py, hypothesis, jinja2, matplotlib, mpi4py, numba, numpy, petsc4py.lib, plotly, pydantic, pytest, pyvista, rich
import scipy, skfem, trimesh, xarray
import softjaw.study.cli

assert h5py.get_config().mpi
petsc4py.lib.ImportPETSc()
PROBE
}

# What the set-up depends on: this script, the dependencies, the interpreter, and where the checkout lies.
key() { { cat setup.sh pyproject.toml; "$1" --version; pwd; } | sha256sum | cut -d ' ' -f 1; }

if command -v flock > /dev/null; then
    exec 9> .set-up.lock
    flock -n 9 || { say "another set-up is at work here; waiting for it"; flock 9; }
fi

if [ -f $stamp ] && [ "$(cat $stamp)" = "$(key $venv/bin/python)" ] && venv_works; then exit 0; fi

started=$SECONDS
python=${PYTHON:-/usr/bin/python3}
missing=$(lacks "$python" | paste -sd ' ')
if [ -n "${missing// /}" ] && [ -z "${PYTHON:-}" ] && [ "$(command -v python3)" != /usr/bin/python3 ] \
    && [ -n "${CONDA_PREFIX:-}" ] && [ -z "$(lacks python3 | tr -d ' \n')" ]; then
    python=$(command -v python3)
    missing=
fi
if [ -n "${missing// /}" ]; then
    if [ "$python" != /usr/bin/python3 ] || ! may_install; then other_ways "$missing"; fi
    install_system_packages "$missing"
    missing=$(lacks "$python" | paste -sd ' ')
    [ -z "${missing// /}" ] || fail "still not found after the installation: $missing"
elif [ "$python" = /usr/bin/python3 ] && { ! has_renderer || slow_blas; }; then
    if may_install; then install_system_packages "a renderer for pictures without a screen, or a fast BLAS"
    else say "no renderer for pictures without a screen (libosmesa6) or no fast BLAS (libopenblas0-serial): all will work, but" \
        "without 3-D pictures, or four times slower"; fi
fi

if [ -d $venv ] && ! $venv/bin/python -c 'import pip' > /dev/null 2>&1; then
    say "$venv does not work (any more); making it anew"
    "$python" -m venv --clear --system-site-packages $venv
elif [ ! -d $venv ]; then
    say "making the virtual environment $venv with $python"
    "$python" -m venv --system-site-packages $venv
elif ! grep -q 'include-system-site-packages = true' $venv/pyvenv.cfg; then
    fail "$venv does not see the system's packages (petsc4py, h5py); remove the folder and run this again"
fi

say "installing softjaw and its Python packages into $venv (a minute or two)"
# as a path: with import hooks Python takes a checkout's own folder for the package where it is started beside it
$venv/bin/python -m pip install -qq --disable-pip-version-check --config-settings editable_mode=compat --editable '.[test]' \
    || fail "pip could not install the packages of pyproject.toml; see its message above"
if [ -n "$(find $venv/lib/python3*/site-packages -maxdepth 1 -iname h5py)" ]; then
    say "removing h5py from $venv: that build has no MPI and hides the system's"
    $venv/bin/python -m pip uninstall --quiet --yes h5py
fi
venv_works || fail "the packages are installed but do not import; '$venv/bin/softjaw doctor' says what is wrong"
# where PYTHONDONTWRITEBYTECODE is set, as in many containers, each start would compile them anew: half a second
$venv/bin/python -m compileall -q fem friction lsfit scoring softjaw study
say "compiling the loops of the solver by a small run (half a minute; what is compiled is kept)"
made=$(mktemp -d)
$venv/bin/softjaw run jobs/smoke.toml -o "$made/smoke.hdf" > /dev/null || say "the run failed; '$venv/bin/softjaw doctor' says what is wrong"
rm -rf "$made"
key $venv/bin/python > $stamp
say "done after $((SECONDS - started)) s"
