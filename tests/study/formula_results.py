"""Result files whose maps are formulas of station, angle and force; nothing is solved."""

from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np

from softjaw.study.quantities import MISSING, Axis, Quantity
from softjaw.study.result import checksums
from softjaw.study.result.datasets import CLOSING_SUMS, SUMS
from softjaw.study.result.hdf5 import StoredFile
from softjaw.study.result.layout import ROOT, Header, Layout
from softjaw.study.result.skeleton import create, report_bytes
from softjaw.study.result.store import Result
from softjaw.study.result.write import ResultWriter, record
from softjaw.study.scene import SceneError, parse_scene
from tests.study.scenes import OVAL

OBJECT = f"[object]\n{OVAL.replace('120', '100')}\n"
SCENE = f"{OBJECT}[candidates]\nstations_mm = [0, 10]\n[load]\nnormal_force_n = [1, 5]\n"
SKELETONS: dict[str, bytes] = {}  # files without values: to copy one is ten times faster than to make it
STATIONS, ANGLES, FORCES = np.linspace(0, 0.04, 5), np.arange(6) * np.pi / 6, np.array([1.0, 2.0, 4.0, 8.0])


def linear(station, angle, force):
    """A map that is hit between its cases: straight along stations, a power of the force, alike at all angles."""
    return (0.01 + 0.1 * station) * force**0.4


def grid_axes(stations=STATIONS, angles=ANGLES, forces=FORCES, sweep=(), poses=False):
    place = Axis("station", np.asarray(stations, float), "" if poses else "m", "station")
    turn = Axis("angle", np.asarray(angles, float), "rad", "angle")
    return (*sweep, place, turn, Axis("normal_force", np.asarray(forces, float), "N", "force"))


def quartic(x, y, t):
    """Coefficients ``(15,)`` of ``x^4 + y^4 + t^4`` with these factors."""
    found = np.zeros(15)
    found[[0, 10, 14]] = x, y, t
    return found


def fresh(path: Path, layout: Layout, header: Header) -> None:
    """A file without values, as ``create`` makes it."""
    axes = [(axis.name, axis.units, axis.long_name, axis.values.tolist(), axis.options) for axis in layout.axes]
    kind = f"{axes}{layout.text()}{header}"
    if kind not in SKELETONS:
        create(path, layout, header)
        SKELETONS[kind] = path.read_bytes()
    path.write_bytes(SKELETONS[kind])


def written(path: Path, layout: Layout, case, header: Header | None = None, **about) -> Path:
    """A file whose case at an index is ``case(index)``: a result, None where it is missing, or why it failed.

    ``about``: what a header that is not given says.
    """
    known = {"digest": "d" * 64, "scene": SCENE, "title": "made", "scene_file": "made.toml"} | about
    with suppress(SceneError, OSError):  # a scene that this version cannot read, or whose mesh is nowhere
        known["digest"] = parse_scene(known["scene"], check_files=False).digest
    fresh(path, layout, header or Header(**known))
    writer = ResultWriter(path, layout, None)
    for row, index in enumerate(np.ndindex(layout.shape)):
        if isinstance(made := case(index), str):
            writer.fail(row, made)
        elif made is not None:
            writer.write(row, record(layout, made))
    writer.close()
    return path


def sealed(path):
    """Give a file the checksums of its values, as somebody would who wants to deceive; its path."""
    with h5py.File(path, "r+") as file:
        stored = StoredFile(path, file)
        result = Result(path, stored, unchecked=True)
        layout, codes = result.layout, result.codes.ravel()
        sums = file[SUMS][()].reshape(layout.rows, -1)
        for column in layout.columns:
            values = file[column.path][()]
            rows = np.flatnonzero(codes != MISSING)
            sums[rows, layout.summed.index(column.path)] = checksums.of_rows(layout, values, rows)
        sums[:, -1] = [checksums.OF_STATE.get(code, 0) for code in codes]
        file[SUMS][...] = sums.reshape(file[SUMS].shape)
        for i, name in enumerate(layout.closing):
            file[CLOSING_SUMS][i] = checksums.of_array(file[f"{ROOT}/{name}"][()])
        sessions = file[f"{ROOT}/provenance/sessions"][()]
        for i in np.flatnonzero(sessions["start"] != b""):
            sessions[i]["crc"] = checksums.of_session(sessions[i])
        file[f"{ROOT}/provenance/sessions"][...] = sessions
        file[ROOT].attrs.modify("checksum", np.uint32(checksums.of_header(stored, layout)))
    return path


def make(
    path: Path, formula=linear, axes=None, scene=SCENE, meshes=1, derived=(), labels=(), added=(), **datasets
) -> Path:
    """A file with ``e_n`` of all models and friction limits by ``formula(*coordinates)``, everything done.

    ``datasets`` come last, by their path below ``/study`` with ``__`` for ``/``: arrays, or functions of what is there.
    """
    axes = axes or grid_axes()
    layout = Layout(axes, 0, derived, ("two meshes",) * (meshes > 1), added)
    fresh(path, layout, Header("d" * 64, scene, "made", "made.toml", labels=labels))
    grid = np.meshgrid(*(axis.values for axis in axes), indexing="ij")
    e_n = np.broadcast_to(formula(*grid), layout.shape)
    force = np.broadcast_to(grid[-1], layout.shape)
    two = np.stack([force, force], axis=-1)
    with h5py.File(path, "r+") as file:
        study = file["study"]
        for k, model in enumerate(("ccm", "pcm", "pcm_projected")):
            study[f"e_n/{model}"][...] = e_n * (1 + 0.1 * k)
            study[f"quality/{model}"][...] = 10 * e_n
            study[f"tau_z_max/{model}"][...] = e_n * force
        study["flags/flags"][...] = 0.0
        study["fingers/S"][...], study["fingers/F_N"][...] = two, two
        study["fingers/f_x_max"][...] = 0.8 * two[..., None]
        study["fingers/pose_rotation"][...] = np.eye(3)
        study["fingers/pose_origin"][...] = [[0.0, 0.0, -0.02], [0.0, 0.0, 0.02]]
        study["fingers/frame_axes"][...], study["fingers/frame_origin"][...] = np.eye(3), [0.0, 0.0, 0.001]
        study["limit_surface/rho"][...] = 0.02
        study["limit_surface/semi_axes"][...] = [0.8, 0.8, 0.008]
        study["limit_surface/coefficients"][...] = quartic(1.0, 1.0, 4.0)
        study["status/code"][...], study["report"][()] = 1, report_bytes("made")
        for name, values in datasets.items():
            target = study[name.replace("__", "/")]
            target[...] = values(target[()]) if callable(values) else values
    return sealed(path)


def without_result(code, message=""):
    """Changes that make case ``(2, 1, 1)`` one without a result."""

    def state(codes):
        codes[2, 1, 1] = code
        return codes

    def text(messages):
        messages[2, 1, 1] = message.encode()
        return messages

    return {"status__code": state, "status__message": text}


def window(axes):
    over = tuple(a.name for a in axes[:-1])
    return (Quantity("force_high", over, "N", "largest force", "as the test says", "derived"),)
