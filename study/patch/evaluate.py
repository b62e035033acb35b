"""What a patch from elsewhere can carry: contact frame, friction maxima, limit surfaces and how well they fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.frame import Frame, FrameFlag, contact_frame, contact_length, in_frame
from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.orientation import behind
from softjaw.friction.patch import ContactPatch, FloatArray, NoContactError
from softjaw.friction.torque import pure_torque
from softjaw.friction.wrench import FrictionLimits, Model, friction_limits, friction_wrench
from softjaw.lsfit.body import ExactSurface
from softjaw.lsfit.ellipsoid import three_motion_ellipsoid
from softjaw.lsfit.misfit import Misfit, misfit
from softjaw.lsfit.samples import normalised_samples, sample_rank
from softjaw.study.case.limit_surface import STANDS_IN, fitted, judging_twists
from softjaw.study.exits import USAGE, StudyError
from softjaw.study.patch.faces import ReadPatch, refuse
from softjaw.study.quantities import MODELS
from softjaw.study.scene.errors import Problem

SURFACES = ("three_motions", "axis_aligned", "full", "quartic")  # as a scene names them
FITTED_ON = 500  # Fibonacci motions; a fit is judged on others
EXACT = 2000  # motions whose hull gives the volume of the limit surface itself, to some 1e-4
EQUAL = 1e-6  # relative difference of extents, and difference of cosines, that decide nothing
SPACE = 3  # dimension of the loads (f_x, f_y, tau_z)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A limit surface of a contact, per unit of S, and its mean errors on motions it was not fitted to.

    ``misfit`` is None where the samples lie in a plane, so that there is no surface to compare with. ``stands_in``
    tells that the fit failed and the ellipsoid of three motions took its place, as in a study.
    """

    surface: Any
    misfit: Misfit | None
    stands_in: bool


@dataclass(frozen=True, eq=False)
class Judged:
    """Everything that is told about one patch.

    Parameters
    ----------
    read : ReadPatch
        The patch in the file's coordinates.
    frame : Frame
        Contact frame.
    x_given : bool
        Whether the user gave the direction of x.
    rho : float
        Longer side of the rectangle around the loaded faces [m].
    limits, tau_pure : mapping
        Friction maxima, and the largest torque without a net force [N m], for each friction model.
    surfaces : mapping
        For each friction model the fitted surfaces by name.
    exact : mapping
        For each friction model the limit surface itself, per unit of S.
    """

    read: ReadPatch
    frame: Frame
    x_given: bool
    rho: float
    limits: Mapping[str, FrictionLimits]
    tau_pure: Mapping[str, float]
    surfaces: Mapping[str, Mapping[str, Fitted]]
    exact: Mapping[str, ExactSurface]

    @property
    def rank(self) -> int:
        """Dimension of the loads that the contact can carry, 3 if nothing is missing."""
        return self.exact["curved"].rank


def judge(read: ReadPatch, mu: float, long_side: FloatArray | None = None) -> Judged:
    """Frame, friction and limit surfaces of a patch.

    Parameters
    ----------
    read : ReadPatch
        Loaded faces in the file's coordinates.
    mu : float
        Coulomb friction coefficient [-].
    long_side : (3,) array, optional
        Direction that becomes x after projection on the contact plane; by default the longer direction of the patch.

    Raises
    ------
    StudyError
        If the normals point to opposite sides, or ``long_side`` along them.
    """
    patch = read.patch
    frame = _frame(read, long_side)
    local = in_frame(patch, frame)
    rho = contact_length(local)
    limits = {model: friction_limits(local, mu, model) for model in MODELS}
    return Judged(
        read, frame, long_side is not None, rho, limits,
        tau_pure={model: pure_torque(local, mu, model) for model in MODELS},
        surfaces={model: _fitted(local, mu, rho, model, limits[model]) for model in MODELS},
        exact={model: _exact(local, mu, rho, model, limits[model].S) for model in MODELS},
    )  # fmt: skip


def _frame(read: ReadPatch, long_side: FloatArray | None) -> Frame:
    patch = read.patch
    try:
        frame = contact_frame(patch, principal_direction(patch) if long_side is None else long_side)
    except NoContactError as error:
        raise StudyError(USAGE, f"{read.file}: {error}") from error
    except ValueError as error:
        raise StudyError(USAGE, f"{read.file}: --long-side: {str(error).replace('x_hint', 'the direction')}") from error
    if frame.flag & FrameFlag.ORIENTATION:
        turned = minority(behind(patch.normal, frame.axes[2]))
        found = f"normals in {told_of(read, turned)} that oppose their neighbours"
        remedy = "orient them to one side before export (ParaView: Generate Surface Normals with Consistency)"
        refuse([Problem(read.file, None, "normal", found, "normals that all point to the same side", remedy)])
    return frame


def minority(chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The chosen ones, or the others where the chosen ones are more than half."""
    return ~chosen if 2 * chosen.sum() > len(chosen) else chosen


def told_of(read: ReadPatch, chosen: NDArray[np.bool_]) -> str:
    """How many of the loaded faces ``(n,)`` are chosen, and where the first of them stands in the file."""
    first = f", the first in {read.place(int(np.argmax(chosen)))}" if chosen.any() else ""
    return f"{int(chosen.sum())} of {len(chosen)} loaded faces{first}"


def principal_direction(patch: ContactPatch) -> FloatArray:
    """Direction ``(3,)`` in which the loaded faces extend most, across their mean normal.

    Where no direction is longer it is the file's axis that lies most nearly in the contact plane. Its largest component
    is positive; of equally large ones the first.
    """
    faces = patch.loaded
    N = faces.load @ faces.normal
    N = N / max(np.linalg.norm(N), np.finfo(float).tiny)
    across = np.eye(3) - np.outer(N, N)
    offset = (faces.centroid - faces.area @ faces.centroid / faces.area.sum()) @ across
    spread, directions = np.linalg.eigh(offset.T @ (faces.area[:, None] * offset))
    if spread[2] - spread[1] <= EQUAL * spread[2]:
        return np.eye(3)[np.argmax(np.abs(N) <= np.abs(N).min() + EQUAL)]
    longest = directions[:, 2]
    return longest * np.sign(longest[np.argmax(np.abs(longest) >= np.abs(longest).max() - EQUAL)])


def _fitted(local: ContactPatch, mu: float, rho: float, model: Model, limits: FrictionLimits) -> dict[str, Fitted]:
    """Fitted surfaces per unit of S."""

    def samples(twists: FloatArray) -> tuple[FloatArray, FloatArray]:
        return normalised_samples(friction_wrench(local, twists, 1.0, model), twists, limits.S, rho)

    (W, T), others = samples(fibonacci_twists(FITTED_ON, rho)), samples(judging_twists(FITTED_ON, rho))
    whole = sample_rank(W) == SPACE
    units = mu * np.array([1.0, 1.0, rho])
    ellipsoid = three_motion_ellipsoid(*(np.array(limits.per_unit_force) / units).tolist(), 1.0)
    found = {}
    for name in SURFACES:
        surface, certificate = fitted(ellipsoid, W, T, name, "least_squares")
        errors = misfit(surface, *others) if whole else None
        found[name] = Fitted(surface.scaled(units), errors, certificate == STANDS_IN)
    return found


def _exact(local: ContactPatch, mu: float, rho: float, model: Model, S: float) -> ExactSurface:
    """The limit surface itself, per unit of S."""
    return ExactSurface(lambda t: friction_wrench(local, t, mu / S, model)[:, [0, 1, 5]], rho, EXACT)
