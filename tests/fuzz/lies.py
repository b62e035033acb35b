"""Result files that lie: sound HDF5 whose contents are not what they seem. Each function spoils an open file."""

import json

import h5py
import numpy as np

EVIL = "\x1b]0;owned\x07</script><script>alert(1)</script>\u2028=1+1"


def put(file, path, data):
    attributes = dict(file[path].attrs) if path in file else {}
    del file[path]
    made = file.create_dataset(path, data=data)
    for name, value in attributes.items():
        if name not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS"):
            made.attrs[name] = value


def options(**changed):
    def spoil(file):
        told = json.loads(file["study"].attrs["options"])
        file["study"].attrs["options"] = json.dumps(told | changed)

    return spoil


def attribute(path, name, value):
    def spoil(file):
        file[path].attrs[name] = value

    return spoil


def data(path, value):
    return lambda file: put(file, path, value)


def values(path, value):
    def spoil(file):
        file[path][...] = value

    return spoil


def linked(path, link):
    def spoil(file):
        del file[path]
        file[path] = link

    return spoil


def enormous(path):
    """72 TiB that are only declared."""

    def spoil(file):
        del file[path]
        file.create_dataset(path, (10**13,), "<f8", chunks=(10**5,))

    return spoil


def all_maps(value):
    def spoil(file):
        for group in file["study"].values():
            for node in group.values() if isinstance(group, h5py.Group) else ():
                if isinstance(node, h5py.Dataset) and node.dtype.kind == "f" and "CLASS" not in node.attrs:
                    node[...] = value

    return spoil


def loop(file):
    file["study/e_n/again"] = file["study"]


def text(name, content):
    def spoil(file):
        raw = content.encode("utf-8", "surrogatepass")
        put(file, f"study/{name}", np.array(raw, h5py.string_dtype("utf-8", max(len(raw), 1))))

    return spoil


def words(file):
    file["study"].attrs["title"] = EVIL
    file["study/candidates/label"][...] = EVIL.encode()[:80]
    file["study/status/message"][...] = EVIL.encode()[:200]
    file["study/status/code"][0, 0, 0] = 2
    sessions = file["study/provenance/sessions"]
    row = sessions[0]
    for name in row.dtype.names:
        if row.dtype[name].kind == "S":
            row[name] = EVIL.encode()[: row.dtype[name].itemsize]
    sessions[0] = row
    for axis in file["study/axes"].values():
        axis.attrs["long_name"] = EVIL


SCENE = '[object]\nshape = "sphere"\nradius_mm = 30\n[candidates]\nstations_mm = [0]\n[load]\nnormal_force_n = [2]\n'
DERIVED = {"name": "x", "units": "", "long_name": "", "definition": "", "axes": []}
DEEP = "[" * 100_000
LIES = {
    "soft link to nothing": linked("study/e_n/ccm", h5py.SoftLink("/nowhere")),
    "enormous map": enormous("study/e_n/ccm"),
    "enormous scene": enormous("study/scene"),
    "recursive group": loop,
    "a map of texts": data("study/e_n/ccm", np.array(["a", "b"], object)),
    "a map without shape": data("study/e_n/ccm", h5py.Empty("f8")),
    "a group for a map": lambda file: (file["study/e_n"].pop("ccm"), file.create_group("study/e_n/ccm")),
    "a dataset for a group": data("study/fingers", np.zeros(3)),
    "no maps": lambda file: file["study"].pop("e_n"),
    "no status": lambda file: file["study"].pop("status"),
    "no study": lambda file: file.pop("study"),
    "no scene": lambda file: file["study"].pop("scene"),
    "NaN axis": values("study/axes/station", np.nan),
    "zero axis": values("study/axes/normal_force", 0.0),
    "empty axis": data("study/axes/station", np.zeros(0)),
    "axis of texts": data("study/axes/station", np.array([b"a"] * 5)),
    "axis of two dimensions": data("study/axes/station", np.zeros((5, 1))),
    "axes that are a number": attribute("study", "axes", 3),
    "axes that do not exist": attribute("study", "axes", np.array(["a", "b", "c"], object)),
    "axes elsewhere": attribute("study", "axes", np.array(["../../x", "..", "/"], object)),
    "units that are a list": attribute("study/axes/station", "units", [1, 2, 3]),
    "units that are words": attribute("study/axes/station", "units", "furlong"),
    "options that are deep": attribute("study", "options", "[" * 60_000),
    "infinite faces": attribute("study", "options", '{"derived": [], "faces": 1e999, "meshes": 1}'),
    "many faces": options(faces=10**9),
    "patches that are not there": options(faces=10**6),
    "sampled wrenches": options(sampled=[0, 1]),
    "derived of no axis": options(derived=[{**DERIVED, "axes": ["q"]}]),
    "derived elsewhere": options(derived=[{**DERIVED, "name": "../../x", "units": 3, "long_name": []}]),
    "unknown needs": options(has=["magic"]),
    "two meshes": options(meshes=2),
    "states that do not exist": values("study/status/code", 7),
    "everything failed": values("study/status/code", 2),
    "NaN everywhere": all_maps(np.nan),
    "1e308 everywhere": all_maps(1e308),
    "-1 everywhere": all_maps(-1.0),
    "scene that is no TOML": text("scene", "= ["),
    "scene that is deep": text("scene", "a = " + DEEP),
    "scene of another study": text("scene", SCENE),
    "scene with orders": text("scene", SCENE + '[output]\nfile = "../../x.hdf"\n'),
    "scene of a mesh": text("scene", '[object]\nshape = "mesh"\nmesh = "/etc/passwd.stl"\nunit = "mm"\n' + SCENE[43:]),
    "scene that is a list": data("study/scene", np.zeros(3)),
    "words with orders": words,
}  # fmt: skip
