"""Commands that solve."""

from __future__ import annotations

import sys
from argparse import Namespace

from mpi4py import MPI

from softjaw.study.case.candidates import with_sampled_grasps
from softjaw.study.cli.quick import petsc_overrides, target
from softjaw.study.launch import solve_scene
from softjaw.study.run.progress import Unbreakable


def run(options: Namespace) -> int:
    """Solve a scene; the same exit code on every rank."""
    # A run in a pipe whose reader leaves must go on solving.
    sys.stdout = Unbreakable(sys.stdout)
    given = [*options.overrides, *petsc_overrides(options.petsc)]
    path = target(options)
    return solve_scene(
        options.scene_read, path, MPI.COMM_WORLD, scene_file=options.scene, overrides=given,
        retry_failed=options.retry_failed,
    )  # fmt: skip


def cost(options: Namespace) -> None:
    """Measure what accuracy costs in time."""
    from softjaw.study.accuracy import cost as costing  # loads matplotlib, which every rank of a run would wait for

    costing.run(options, with_sampled_grasps(options.scene_read))
