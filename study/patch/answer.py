"""The answer about patches from elsewhere: one record in SI units, for programs, that the text is made from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.friction.frame import FrameFlag
from softjaw.friction.orientation import wound
from softjaw.study.patch.evaluate import SPACE, Judged, minority, told_of
from softjaw.study.patch.grasp import ANTIPODAL, Grasp
from softjaw.study.quantities import MODELS

UNITS = {
    "area": "m^2", "pressure": "Pa", "S": "N", "F_N": "N", "rho": "m", "origin": "m", "centre_of_pressure": "m",
    "f_x_max": "N", "f_y_max": "N", "tau_z_max": "N m", "tau_pure": "N m", "e_n": "m", "e_n_projected": "m",
    "volume": "m", "semi_axes": "-, -, m", "E_dir": "rad", "distance": "m", "object_length": "m",
    "contact_length": "m", "misalignment": "rad",
}  # fmt: skip
DEFINITIONS = {
    "S": "sum of pressure times area over the patch",
    "F_N": "its part along the contact normal: the force of the gripper",
    "rho": "longer side of the rectangle round the loaded faces in the contact frame",
    "curved, flat, projected": "every face resists in its own plane; all faces in one plane, scaled by S (the paper's"
    " planar model); the same scaled by F_N",
    "f_x_max, f_y_max, tau_z_max": "largest friction along x and y, and about the contact normal through the origin",
    "tau_pure": "largest friction torque while no net force is transmitted",
    "e_n": "tau_z_max / (mu S)",
    "e_n_projected": "tau_z_max / (mu F_N)",
    "limit surface": "all loads (f_x, f_y, tau_z) that friction can carry, here per newton of S",
    "E_rad, E_dir": "mean error of a fitted surface's radius, and mean angle between its normal and the sliding motion",
    "quality": "volume of the grasp wrench space of both contacts (L-infinity, S = 1 each)",
    "epsilon": "radius of the largest ball round 0 in it, for a centre of mass halfway between the contacts; lower and"
    " upper bound, which a quartic leaves apart",
}
FRAME = {
    FrameFlag.CYCLE: "the contact normal is a mean, because its search went in a circle between faces",
    FrameFlag.HOLE: "the centre of pressure lies over a hole of the loaded faces, so the nearest face gave the contact"
    " frame",
    FrameFlag.NO_CORNERS: "the faces have no corners, so the face with the nearest centre gave the contact frame",
    FrameFlag.OVERHANG: "some loaded faces are turned more than 90 deg from the contact normal",
}


@dataclass(frozen=True, eq=False)
class Answer:
    """Patches, the grasp by them if there is one, and how they were judged."""

    mu: float
    patches: Sequence[Judged]
    grasp: Grasp | None


def remarks(answer: Answer) -> list[str]:
    """What the reader should know, in sentences."""
    told = []
    several = len(answer.patches) > 1
    for judged in answer.patches:
        name = f"{judged.read.file}: " if several else ""
        told += [note if note.startswith(judged.read.file) else name + note for note in _patch_remarks(judged)]
    if answer.grasp is not None:
        told += _grasp_remarks(answer.grasp, several)
    return told


def _patch_remarks(judged: Judged) -> list[str]:
    frame, told = judged.frame, list(judged.read.notes)
    if not judged.x_given:
        told.append("x follows the longer direction of the patch, because no --long-side was given")
    for flag, sentence in FRAME.items():
        if frame.flag & flag:
            share = f": {frame.overhang_count}, with {100 * frame.overhang_share:.2g} % of S"
            told.append(sentence + share * (flag == FrameFlag.OVERHANG))
    if frame.flag & FrameFlag.WINDING:
        against = told_of(judged.read, minority(wound(judged.read.patch) < 0))
        told.append(f"the corners of {against}, are wound against their normals; the normals were taken as they are")
    for model in MODELS:
        failed = [name for name, fit in judged.surfaces[model].items() if fit.stands_in]
        if failed:
            told.append(f"{model} model: no {' and no '.join(failed)} surface could be fitted, the ellipsoid of three "
                        "motions stands in")  # fmt: skip
    if judged.rank < SPACE:
        space = {1: "one line", 2: "a plane"}.get(judged.rank, "a point")
        told.append(f"the loads that friction can carry fill {space} only (rank {judged.rank}): the limit surface has "
                    "no volume and no fit is judged")  # fmt: skip
    return told


def _grasp_remarks(grasp: Grasp, two_files: bool) -> list[str]:
    told = []
    if grasp.misalignment > ANTIPODAL:
        told.append(f"the contacts are {np.degrees(grasp.misalignment):.2g} deg from antipodal")
    if grasp.slips:
        told.append("the line that joins the contacts leaves a friction cone: the grasp slips as it stands")
    if not two_files:
        told.append("the second contact of the grasp is the same patch facing the first, because no --other was given")
    return told


def as_record(answer: Answer) -> dict[str, Any]:
    """Everything as plain numbers, lists and texts, in SI units; what is not there is None."""
    grasp = answer.grasp
    return {
        "mu": answer.mu,
        "patches": [_patch_record(judged) for judged in answer.patches],
        "grasp": None if grasp is None else _grasp_record(grasp),
        "remarks": remarks(answer),
        "units": UNITS,
        "definitions": DEFINITIONS,
    }


def as_json(answer: Answer) -> str:
    """The record as one JSON object."""
    return json.dumps(_plain(as_record(answer)), indent=2, allow_nan=False)


def _patch_record(judged: Judged) -> dict[str, Any]:
    patch, frame, limits = judged.read.patch, judged.frame, judged.limits
    return {
        "file": judged.read.file,
        "faces": judged.read.faces,
        "loaded_faces": len(patch.area),
        "area": patch.area.sum(),
        "pressure": patch.pressure.max(),
        "S": limits["curved"].S,
        "F_N": limits["curved"].F_N,
        "rho": judged.rho,
        "frame": {
            "origin": frame.origin,
            "axes": frame.axes,
            "centre_of_pressure": frame.centre_of_pressure,
            "flag": int(frame.flag),
            "overhang_count": frame.overhang_count,
            "overhang_share": frame.overhang_share,
        },
        "rank": judged.rank,
        "friction": {
            model: {
                "f_x_max": limits[model].f_x,
                "f_y_max": limits[model].f_y,
                "tau_z_max": limits[model].tau_z,
                "tau_pure": judged.tau_pure[model],
                "e_n": limits[model].e_n,
                "e_n_projected": limits[model].e_n_projected,
            }
            for model in MODELS
        },
        "limit_surface": {model: _surface_record(judged, model) for model in MODELS},
    }


def _surface_record(judged: Judged, model: str) -> dict[str, Any]:
    found: dict[str, Any] = {
        "exact": {"volume": judged.exact[model].volume, "semi_axes": judged.exact[model].semi_axes}
    }
    for name, fit in judged.surfaces[model].items():
        errors = fit.misfit
        found[name] = {
            "volume": fit.surface.volume,
            "semi_axes": fit.surface.semi_axes,
            "stands_in": fit.stands_in,
            "E_1": None if errors is None else errors.E1,
            "E_rad": None if errors is None else errors.Erad,
            "E_dir": None if errors is None else np.radians(errors.Edir),
        }
    return found


def _grasp_record(grasp: Grasp) -> dict[str, Any]:
    return {
        "surface": grasp.surface,
        "distance": grasp.distance,
        "object_length": grasp.object_length,
        "contact_length": grasp.contact_length,
        "misalignment": grasp.misalignment,
        "slips": grasp.slips,
        "score": {
            model: {
                "quality": scored.quality,
                "quality_l1": scored.quality_l1,
                "epsilon": [scored.epsilon.lower, scored.epsilon.upper],
            }
            for model, scored in grasp.scores.items()
        },
    }


def _plain(value: Any) -> Any:
    """Numbers, lists and texts that JSON knows."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not np.isfinite(value) else value
