"""Commands that solve."""

import sys
from argparse import Namespace

from mpi4py import MPI

from softjaw.study.case.candidates import with_sampled_grasps
from softjaw.study.cli.quick import petsc_overrides, results_folder, target
from softjaw.study.launch import solve_objects, solve_scene
from softjaw.study.messages import DONE, SOME_FAILED, write_file
from softjaw.study.result.read import open as open_dataset
from softjaw.study.run.progress import Unbreakable
from softjaw.study.show import objects
from softjaw.study.show.status import counts
from softjaw.study.table import terminal_width


def run(options: Namespace) -> int:
    """Solve a scene; the same exit code on every rank."""
    # A run in a pipe whose reader leaves must continue solving.
    sys.stdout = Unbreakable(sys.stdout)
    if options.folder:
        out = results_folder(options)
        code = solve_objects(options.folder, out, MPI.COMM_WORLD, retry_failed=options.retry_failed)
        if MPI.COMM_WORLD.rank == 0:
            print(objects.summary(out / "index.hdf", terminal_width()), flush=True)
        return code
    about = {"scene_file": options.scene, "overrides": [*options.overrides, *petsc_overrides(options.petsc)]}
    return solve_scene(options.scene_read, target(options), MPI.COMM_WORLD, **about, retry_failed=options.retry_failed)


def cost(options: Namespace) -> int:
    """Solve a few cases of a scene on several meshes, and say what their accuracy costs in time."""
    from softjaw.study.accuracy.cost import cost_picture, cost_scene, cost_text  # matplotlib

    sys.stdout = Unbreakable(sys.stdout)
    path, comm = target(options, "-cost"), MPI.COMM_WORLD
    scene = cost_scene(with_sampled_grasps(options.scene_read))
    code = solve_scene(scene, path, comm, scene_file=options.scene, overrides=options.overrides, last=counts)
    if comm.rank == 0 and code in (DONE, SOME_FAILED):
        ds = open_dataset(path)
        write_file(path.with_suffix(".png"), cost_picture(ds))
        print(f"{cost_text(ds)}\nwritten: {path}, {path.with_suffix('.png')}", flush=True)
    return code
