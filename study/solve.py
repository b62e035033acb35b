"""The two functions that need PETSc: one case in memory, and a whole study. They load the solvers when they are called.

So the rest of a script runs where PETSc and MPI are missing.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softjaw.study.messages import LACKING, with_ending
from softjaw.study.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from softjaw.study.one_case import Case


def press(
    scene: Scene,
    station: float | None = None,
    angle: float | None = None,
    force: float | None = None,
    *,
    candidate: int | None = None,
    pose: Mapping[str, Any] | ArrayLike | tuple[ArrayLike, ArrayLike] | None = None,
) -> Case:
    """Solve one case in memory: press both fingers at one place with one force, and judge the grasp.

    The numbers are those that `run` stores for this case, bit for bit; a sampled grasp that `run` leaves on the coarse
    mesh is solved on the scene's. A grasp or a force that the scene does not have is added to its own.

    Parameters
    ----------
    scene : Scene
        Without a sweep.
    station, angle : float
        Along the object's axis [m] and about it [rad]. The angle may be left out where the scene has one, or where the
        object looks the same from every side.
    force : float
        Normal force per finger [N].
    candidate : int, optional
        Number of an explicit or sampled pose of the scene, from 0, instead of station and angle.
    pose : mapping, (4, 4) array or tuple, optional
        A pose instead of them, in the frame of the object's own file: ``point_mm``, ``approach`` and ``long_side`` as
        in a scene's ``[[candidates.poses]]``; or a matrix whose columns are the pads' long side, their short side,
        finger 1's approach, and a point on the line along which the fingers close [m]; or what `GraspPoint.pose` gives.

    Returns
    -------
    Case
        Values, errors, contact patches, friction limits and limit surfaces.

    Raises
    ------
    ValueError, TypeError
        Arguments that name no case, as a station off the object.
    StudyError
        The case has no values (`CaseError`, a part of it): it does not converge, or the gripper does not fit.
    ImportError
        PETSc is missing.

    Notes
    -----
    Xu, Alt, Zhang, Steinbach: Grasping Posture Estimation for a Two-Finger Parallel Gripper with Soft Material Jaws
    using a Curved Contact Area Friction Model.

    Examples
    --------
    >>> scene = Scene.from_file("jobs/smoke.toml", ["gripper.elements=[8, 4, 2]"])
    >>> case = press(scene, station=0.0, angle=0.0, force=1.0)
    >>> case.e_n == case.limits["ccm"].e_n, case.result.effects["friction_pressure_coupling"].level
    (True, 'tangential traction')
    """
    if force is None:
        raise TypeError("force is missing: give the normal force per finger in N")
    try:
        from threadpoolctl import threadpool_limits

        from softjaw.study.one_case import solved_case
    except ImportError as error:
        raise ImportError(LACKING.format(what="press", error=error), name=error.name) from error
    # The order of a sum, so its last bits, depends on the number of threads; numpy has been loaded with any.
    with threadpool_limits(1):
        return solved_case(scene, station, angle, force, candidate, pose)


def run(scene: Scene, file: str | Path, comm: Any = None, *, retry_failed: bool = False) -> int:
    """Solve a study into a result file, as ``softjaw run`` does; run again to resume.

    Collective: under mpirun every rank calls it, with the same arguments. It prints its progress.

    Parameters
    ----------
    scene : Scene
    file : path
        Result file, which ends in ``.hdf``. One that is there already is continued, if it is of the same scene.
    comm : mpi4py communicator, optional
        Ranks that share the work; by default all of them.
    retry_failed : bool
        Whether cases that failed before are tried again.

    Returns
    -------
    int
        Exit code, the same on every rank: 0 done, 6 some cases failed, 75 stopped by a signal with cases left. So
        ``sys.exit(run(...))`` ends a script as the command ends.

    Raises
    ------
    StudyError
        On every rank: the scene cannot be solved, the file is in use, of another scene, or cannot be written.
    ImportError
        PETSc or MPI is missing.

    Examples
    --------
    ``mpirun -n 8 python study.py`` with ``softjaw.run(softjaw.Scene.from_file("bottle.toml"), "bottle.hdf")`` in it.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {scene!r}: expected a Scene, as Scene.from_file(file) gives")
    path = with_ending("file", file, ".hdf")
    os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # before h5py is imported: its own guess misses some launchers
    try:
        from mpi4py import MPI
        from threadpoolctl import threadpool_limits

        from softjaw.study.launch import solve_scene
    except ImportError as error:
        raise ImportError(LACKING.format(what="run", error=error), name=error.name) from error
    with threadpool_limits(1):
        return solve_scene(scene.reread(), path, MPI.COMM_WORLD if comm is None else comm, retry_failed=retry_failed)
