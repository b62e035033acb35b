"""The door to PETSc: one nonlinear problem with a fixed sparsity, solved on this rank alone.

``newtonls`` with full steps on the semismooth (primal-dual active set) form is the default; the option
``-contact_snes_type vinewtonrsls`` solves the same problem as a mixed complementarity problem with bounds.  Every
linear system is factorised by MUMPS, by L D L^T where the problem can make its tangent symmetric, else by LU; the
symbolic analysis is kept as long as the pattern is. Steps that older factors are good enough for do without a
factorisation of their own, see `NonlinearSolver`.

The BLAS libraries of this process take their work memory here, while there is room for it: where a limit (``ulimit
-v``, a batch system, ``run.memory_gb``) leaves less, older OpenBLAS asks for ever and newer one ends the process, both
without a word.
"""

import ctypes
import importlib.util
import math
import mmap
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Protocol, TypeVar, cast

import numpy as np
import scipy.linalg
from scipy.sparse import csr_matrix

from softjaw.fem.assembly import Pattern
from softjaw.fem.errors import ConvergenceError, SpentError
from softjaw.friction.patch import FloatArray

Result = TypeVar("Result")
ROOM = 160 * 2**20  # bytes that are free before a library is let loose: the largest work memory and what goes with it


def take_buffers(*others: Callable[[], object]) -> None:
    """Let numpy's and scipy's BLAS take their work memory, then those that the operations ``others`` reach.

    Raises `MemoryError`: where addresses are too few for one of them.
    """
    small = np.eye(2)
    # the addresses are only reserved, not touched: the look costs no memory
    for operation in (lambda: np.linalg.solve(small, small), lambda: scipy.linalg.lu_factor(small), *others):
        try:
            mmap.mmap(-1, ROOM, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, prot=mmap.PROT_READ).close()
        except OSError as error:
            text = f"the linear algebra library lacks {ROOM / 1e6:.0f} MB of address space at once"
            raise MemoryError(text) from error
        operation()


def _find_petsc4py() -> None:
    """Debian installs petsc4py below PETSc's own folder, where only the -dev package's link makes Python look."""
    if importlib.util.find_spec("petsc4py") is None:
        for folder in sorted(Path("/usr/lib/petscdir").glob("petsc3*/*-real/lib/python3/dist-packages"), reverse=True):
            if (folder / "petsc4py").is_dir():
                sys.path.append(str(folder))
                return
        text = "petsc4py is missing; on Debian and Ubuntu: apt install python3-petsc4py, elsewhere set PETSC_DIR"
        raise ImportError(text)


_find_petsc4py()
import petsc4py  # noqa: E402  (only importable once the path is known)

# no options from files in the working directory; Python, not PETSc, answers signals
petsc4py.init(["softjaw", "-skip_petscrc", "-no_signal_handler"])
from petsc4py import PETSc  # noqa: E402  (after init, as petsc4py requires)


def _dense_factors() -> None:
    """Factors of a small dense matrix, by PETSc's LAPACK."""
    matrix = PETSc.Mat().createDense((2, 2), array=np.eye(2), comm=PETSc.COMM_SELF)
    matrix.assemble()
    matrix.factorLU(*matrix.getOrdering("natural"))
    matrix.destroy()


take_buffers(_dense_factors)
# without the log PETSc keeps no times of its own
PETSc.Log.begin()
LIBRARY = ctypes.CDLL(PETSc.__file__)  # for what petsc4py does not reach
REASONS = {value: name for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)}
OUT_OF_MEMORY = (-5, -7, -13)  # INFOG(1) of MUMPS
WITHIN, FAST = 1e5, 0.05  # see NonlinearSolver
# Iterations in which the residual has to fall below a part `SLOW` of the three before: on a drill and a bracket this
# ends 12 of 1545 good solves, and of 127 failed ones it saves more than half of the iterations.
STALLED, SLOW = 5, 0.7
PREFIX = "contact_"  # of the options of a solve
PRINTING = re.compile("monitor|view|converged_reason")


class Problem(Protocol):
    """What a nonlinear problem tells the solver.

    A problem with a method ``keep(x, first) -> bool`` lets steps be made with older factors, see `NonlinearSolver`; it
    says whether the step from ``x`` may. ``first``: the factors are from the end of the solve before, whose solution is
    ``x``. Unknowns with the index ``non_negative`` are bounded by zero where the solver treats complementarity itself.

    One with a method ``right_side(R)`` makes Newton's steps with another system where the solver lets it: the tangent
    gives the step that belongs to the residual ``R`` with that right-hand side. It says whether its tangent has a
    ``symmetric`` form; the solver sets ``condensed`` to get that one, and ``stepped`` where it asks for the right side.
    """

    size: int
    pattern: Pattern
    non_negative: slice
    complementarity: bool

    def residual(self, x: FloatArray) -> FloatArray:
        """Residual ``(size,)``."""

    def tangent(self, x: FloatArray) -> None:
        """Fill ``pattern.values``; the pattern may grow before."""

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """Factor in (0, 1] by which the step ``x - factor * step`` must be shortened."""


@dataclass
class Seconds:
    """Where the time of the solves went [s]."""

    assembly: float = 0.0
    factorisation: float = 0.0
    total: float = 0.0


def factorisation_seconds() -> float:
    """Seconds this process has spent so far in numeric and symbolic factorisation and triangular solves."""
    events = ("MatLUFactorSym", "MatLUFactorNum", "MatCholFctrSym", "MatCholFctrNum", "MatSolve")
    return sum(PETSc.Log.Event(name).getPerfInfo()["time"] for name in events)


@dataclass
class NonlinearSolver:
    """Newton solver of one problem; the matrix pattern and its symbolic factorisation live as long as it does.

    Where the problem allows it, two kinds of steps take the factors of the tangent before: the first one from the
    solution of the solve before, where they are nearly exact; and the last ones, once the residual is within `WITHIN`
    tolerances of its goal and falls to less than a part `FAST` in every step. What comes of them is judged by the same
    residual, so they cost steps but no accuracy. They do end just below the tolerance, where a Newton step would go far
    beyond; so a caller whose tolerance is loose sets ``thrifty`` to False, which rules out the latter kind.

    ``options``: PETSc options with the prefix, as ``{"contact_snes_max_it": 50}``; they override the defaults. A caller
    sets ``iterations_left``, Newton iterations that further solves may take in all, failed ones too, and ``patient``,
    whether a solve continues where its residual stalls.
    """

    problem: Problem
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        comm, n = PETSc.COMM_SELF, self.problem.size
        self.seconds, self.thrifty, self.patient, self.iterations_left = Seconds(), True, True, math.inf
        pattern = self.problem.pattern
        self._stored = pattern.start
        self._stepped: Any = None  # the problem, where it changes the system of a step
        self._condensed = False
        self._norms: list[float] = []  # of the residual, at every step of this solve
        self._end: FloatArray | None = None  # solution of the solve before
        self._matrix = PETSc.Mat().createAIJ((n, n), csr=(pattern.start, pattern.column, pattern.values), comm=comm)
        self._x, self._f = self._matrix.createVecs()
        snes = self._snes = PETSc.SNES().create(comm)
        snes.setOptionsPrefix(PREFIX)
        snes.setType("newtonls")
        snes.setFunction(self._on_residual, self._f)
        snes.setJacobian(self._on_tangent, self._matrix)
        self._change_steps()
        with self._options_in_effect():
            snes.setFromOptions()
        self.problem.complementarity = snes.getType().startswith("vi")
        if self.problem.complementarity:
            lower, upper = np.full(n, -PETSc.INFINITY), np.full(n, PETSc.INFINITY)
            lower[self.problem.non_negative] = 0.0
            snes.setVariableBounds(*(PETSc.Vec().createWithArray(b, comm=comm) for b in (lower, upper)))
        snes.setLineSearchPreCheck(self._on_step)

    def _change_steps(self) -> None:
        """Let the problem change the system of a step if it does so and the solver is one that gets on with it."""
        kind = (PETSc.Options().getAll() | self.options).get(f"{PREFIX}snes_type", "newtonls")
        # others use residual and tangent for more than a step, so these have to belong together
        if kind == "newtonls" and hasattr(self.problem, "right_side"):
            self._stepped = self.problem
            self._stepped.stepped = True
            self._condensed = self._stepped.condensed = self._stepped.symmetric
        if self._condensed:
            self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    @contextmanager
    def _options_in_effect(self) -> Iterator[None]:
        """Our defaults and the caller's options in its database, then out again; PETSC_OPTIONS wins over defaults."""
        database = PETSc.Options()
        given = database.getAll()
        # thin structures jump by orders of magnitude in the first iteration; a line search on the residual stalls there
        defaults: dict[str, Any] = {
            "snes_linesearch_type": "basic", "snes_divergence_tolerance": 1e30, "snes_stol": 0.0, "snes_rtol": 1e-50,
            "snes_max_it": 25,
            # direct: contact makes the matrix indefinite or not symmetric, and thin walls make it ill-conditioned
            "ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps",
        }  # fmt: skip
        if hasattr(self.problem, "symmetric"):
            # entries of pads are of one size: to scale them, or to look for large ones, takes time and gains no digit
            defaults |= {"pc_type": "cholesky"} if self._condensed else {"mat_mumps_icntl_6": 0}
            defaults["mat_mumps_icntl_8"] = 0
            if self.problem.size > 200 or not self._condensed:
                # PORD, which ends the process at a symmetric matrix of few zeros; METIS and SCOTCH are rarely built in
                defaults["mat_mumps_icntl_7"] = 4
        mine = {PREFIX + key: value for key, value in defaults.items()}
        mine = {key: value for key, value in mine.items() if key not in given} | dict(self.options)
        for key, value in mine.items():
            database.setValue(key, None if value is True else value)  # a flag such as snes_monitor takes no value
        try:
            yield
        finally:
            # the database is the whole process's: other solvers must not find our options
            for key in mine:
                if key in given:
                    database.setValue(key, given[key])
                else:
                    database.delValue(key)

    def solve(self, x: FloatArray, tolerance: float, iterations: int | None = None) -> tuple[FloatArray, int]:
        """Solve from ``x`` until the residual's norm is below ``tolerance``; returns the solution and the iterations.

        Raises `ConvergenceError`: when the solver stops for any other reason; `SpentError`: when none of the iterations
        that the caller allows is left; `MemoryError`: when there is no memory for the factors.
        """
        if self.iterations_left <= 0:
            raise SpentError
        snes, start, factor = self._snes, time.perf_counter(), factorisation_seconds()
        _, _, _, limit = snes.getTolerances()
        # relative and step tolerances are off, so a solve ends by the force out of balance alone
        snes.setTolerances(atol=tolerance, max_it=iterations or limit)
        self._x.array[:] = x
        self._norms, self._goal, self._limit = [], tolerance, iterations or limit
        try:
            with self._options_in_effect():  # MUMPS reads its own when it first analyses the matrix
                snes.solve(None, self._x)
        except PETSc.Error as error:
            # factors that failed half way must not be taken for those of the next solve
            snes.getKSP().getPC().reset()
            text = "a linear system of the contact solve is singular: something is not supported"
            raise ConvergenceError(text) from error
        finally:
            snes.setTolerances(max_it=limit)
            self.iterations_left -= max(1, snes.getIterationNumber())
            # unknown until this solve has converged: a failed one leaves no solution to start from
            self._end = None
            self.seconds.total += time.perf_counter() - start
            self.seconds.factorisation += factorisation_seconds() - factor
        reason, done = snes.getConvergedReason(), snes.getIterationNumber()
        # too little memory looks like a singular matrix to PETSc, but shorter load steps would not help
        if reason == PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE and self._out_of_memory():
            snes.getKSP().getPC().reset()
            raise MemoryError(f"for the factors of {self.problem.size} unknowns")
        if reason <= 0:
            failed = ConvergenceError(
                f"the contact solve stopped with {REASONS.get(reason, reason)} after {done} iterations at residual "
                f"{snes.getFunctionNorm():.3e} N; see it with '-- -{PREFIX}snes_monitor'"
            )
            if self._stalls():
                failed.end = self._x.array.copy(), snes.getFunctionNorm()
            raise failed
        self._end = self._x.array.copy()
        return self._end.copy(), done

    def approach(self, x: FloatArray, tolerance: float, iterations: int) -> tuple[FloatArray, float, float]:
        """As `solve`, converged or not: iterate, norm of its residual, and that over the norm one iteration before."""
        try:
            x, _ = self.solve(x, tolerance, iterations)
        except ConvergenceError:
            x = self._x.array.copy()
        norm = self._snes.getFunctionNorm()
        return x, norm, norm / self._norms[-1] if self._norms else 0.0

    def _stalls(self) -> bool:
        """Whether the residual has not fallen any more for some iterations, as where an active set alternates."""
        before, after = self._norms[-STALLED - 3 : -STALLED], self._norms[-STALLED:]
        return len(self._norms) > 2 * STALLED and min(after) > SLOW * min(before)

    def _out_of_memory(self) -> bool:
        factors = self._snes.getKSP().getPC()
        return factors.getFactorSolverType() == "mumps" and factors.getFactorMatrix().getMumpsInfog(1) in OUT_OF_MEMORY

    def is_at(self, x: FloatArray) -> bool:
        """Whether the last solve ended at ``x``, so that the factors at hand are those of a tangent close to it."""
        return self._end is not None and np.array_equal(x, self._end)

    def negative_eigenvalues(self, values: FloatArray) -> int:
        """Their number for the symmetric matrix of ``values`` in the tangent's pattern: negative pivots of LDL^T.

        An eigenvalue within rounding of zero may count as either; all of them count where MUMPS gives up.
        """
        pattern = self.problem.pattern
        factors = Factors(csr_matrix((values, pattern.column, pattern.start)), symmetric=True)
        infog = factors.factor.getMumpsInfog
        negative = infog(12) if infog(1) == 0 else self.problem.size
        factors.destroy()
        return negative

    def answer(self, right: FloatArray) -> FloatArray:
        """Solution of a linear system with the last solve's last tangent; its factors are at hand."""
        # between two solves nobody reads these vectors
        self._f.array[:] = self._stepped.right_side(right) if self._stepped else right
        self._snes.getKSP().solve(self._f, self._x)
        return self._x.array.copy()

    def forget(self) -> None:
        """Let the next solve be that of a new solver."""
        self._end = None
        # MUMPS orders symmetric matrices, and those of walls, by the first values that it sees
        if self._condensed or not hasattr(self.problem, "symmetric"):
            self._snes.getKSP().getPC().reset()

    def destroy(self) -> None:
        """Give the factors' memory back."""
        for thing in (self._snes, self._matrix, self._x, self._f):
            thing.destroy()

    def _timed(self, work: Callable[[], Result]) -> Result:
        start = time.perf_counter()
        result = work()
        self.seconds.assembly += time.perf_counter() - start
        return result

    def _on_residual(self, _snes, x, f) -> None:
        f.array[:] = self._timed(lambda: self.problem.residual(x.array_r))

    def _on_tangent(self, snes, x, matrix, _preconditioner) -> None:
        self._norms.append(snes.getFunctionNorm())
        if not self.patient and self._stalls():
            # the solver ends behind this step, which the factors at hand are good enough for
            snes.setConvergedReason(PETSc.SNES.ConvergedReason.DIVERGED_DTOL)
            return
        # a matrix that nobody touches is not factorised again
        if not self._keeps(x.array_r):
            self._timed(lambda: self._fill(x.array_r, matrix))
        if self._stepped:
            # between the norm of the residual and the linear system with it: nobody asks for it again
            self._f.array[:] = self._stepped.right_side(self._f.array_r)

    def _fill(self, x: FloatArray, matrix: PETSc.Mat) -> None:
        self.problem.tangent(x)
        pattern = self.problem.pattern
        if pattern.start is not self._stored:
            # the matrix gets the pattern's new rows; the old symbolic analysis belongs to the old ones
            self._stored = pattern.start
            matrix.setPreallocationCSR((pattern.start, pattern.column, pattern.values))
            self._snes.getKSP().getPC().reset()
        _set_values(matrix, pattern.values)

    def _keeps(self, x: FloatArray) -> bool:
        """Whether the step from ``x`` is made with the factors at hand."""
        keep, norms = getattr(self.problem, "keep", None), self._norms
        if keep is None or self.problem.complementarity:
            return False
        # the first step of a solve: exact enough if it starts where the last solve ended
        if len(norms) == 1:
            return self.is_at(x) and keep(x, True)
        # near the limit of iterations Newton's quadratic end is worth its factorisation
        # the last iterations that a solve may take are always made with new factors
        if not self.thrifty or len(norms) > self._limit - 3:
            return False
        return norms[-1] <= min(FAST * norms[-2], WITHIN * self._goal) and keep(x, False)

    def _on_step(self, x, y) -> bool:
        factor = self.problem.shorten(x.array_r, y.array_r)
        y.scale(factor)
        return factor < 1.0


def _set_values(matrix: PETSc.Mat, values: FloatArray) -> None:
    """Copy all ``values`` of compressed rows into a matrix that was made with them.

    petsc4py goes through ``MatSetValues``, which looks for the place of every single one.
    """
    # the array of a sequential AIJ matrix is the values in the order of its rows, as in `Pattern`
    stored = ctypes.POINTER(ctypes.c_double)()
    handle = ctypes.c_void_p(matrix.handle)
    LIBRARY.MatSeqAIJGetArray(handle, ctypes.byref(stored))
    np.ctypeslib.as_array(stored, values.shape)[:] = values
    LIBRARY.MatSeqAIJRestoreArray(handle, ctypes.byref(stored))
    matrix.assemble()


class Factors:
    """Factors of one matrix by MUMPS, LU or of a ``symmetric`` one L D L^T, for many right-hand sides."""

    def __init__(self, matrix: csr_matrix, symmetric: bool = False) -> None:
        self._matrix = PETSc.Mat().createAIJ(
            matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data), comm=PETSc.COMM_SELF
        )
        # MUMPS counts negative pivots only in a symmetric factorisation; by Sylvester's law they are the eigenvalues'
        self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, symmetric)
        self._pc = PETSc.PC().create(PETSc.COMM_SELF)
        self._pc.setType("cholesky" if symmetric else "lu")
        self._pc.setFactorSolverType("mumps")
        self._pc.setOperators(self._matrix)
        self._pc.setUp()
        self.factor = self._pc.getFactorMatrix()

    def solve(self, B: FloatArray) -> FloatArray:
        """Solutions ``X`` of ``A X = B`` for a vector ``(n,)`` or the columns of ``(n, m)``, few enough for the memory.

        Raises `ConvergenceError`: when the matrix is singular.
        """
        columns = np.asfortranarray(B.reshape(len(B), -1))
        # dense PETSc matrices take over the memory they are given, so each gets an array of its own
        rhs, solution = (
            PETSc.Mat().createDense(columns.shape, array=a, comm=PETSc.COMM_SELF)
            for a in (columns.copy(order="F"), np.zeros_like(columns, order="F"))
        )
        try:
            self.factor.matSolve(rhs, solution)
        except PETSc.Error as error:  # the factorisation itself fails silently
            text = f"a linear system of {len(B)} unknowns is singular; is everything supported?"
            raise ConvergenceError(text) from error
        X = solution.getDenseArray().copy()
        rhs.destroy()
        solution.destroy()
        return X.reshape(B.shape)

    def destroy(self) -> None:
        """Give the factors' memory back."""
        # the factor matrix too: what asked for it holds it as long as the preconditioner does
        for thing in (self.factor, self._pc, self._matrix):
            thing.destroy()


def options_elsewhere() -> list[str]:
    """Names of a solve's options that the environment variable PETSC_OPTIONS has set."""
    return [name for name in PETSc.Options().getAll() if name.startswith(PREFIX)]


def unknown_options(options: dict[str, Any]) -> list[str]:
    """Names among ``options`` that no solver asks PETSc for, misspelt ones for example; printing ones are not judged.

    petsc4py has no binding for ``PetscOptionsUsed``, so it is called in the library that petsc4py has loaded.
    """
    judged = {name: value for name, value in options.items() if not PRINTING.search(name)}
    # x = 1 of a few unknowns is enough for PETSc to read every option; PORD ends the process at a matrix without zeros
    diagonal = np.arange(30, dtype=np.int32)
    pattern = Pattern(len(diagonal), diagonal, diagonal)
    pattern.values[:] = 1.0
    problem = SimpleNamespace(
        size=pattern.size, pattern=pattern, complementarity=False, non_negative=slice(0),
        residual=lambda x: x - 1.0, tangent=lambda x: None, shorten=lambda x, step: 1.0,
    )  # fmt: skip
    solver = NonlinearSolver(cast(Problem, problem), judged)
    unknown = []
    with solver._options_in_effect():
        solver._snes.setFromOptions()
        solver._snes.solve(None, solver._x)  # MUMPS reads its options here
        for name in judged:
            used = ctypes.c_int(0)
            LIBRARY.PetscOptionsUsed(None, name.encode(), ctypes.byref(used))
            if not used.value:
                unknown.append(name)
    solver.destroy()
    return unknown
