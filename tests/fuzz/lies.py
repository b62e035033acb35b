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
    return lambda file: text("layout", json.dumps(json.loads(file["study/layout"][()]) | changed))(file)


def attribute(path, name, value):
    return lambda file: file[path].attrs.__setitem__(name, value)


def data(path, value):
    return lambda file: put(file, path, value)


def values(path, value):
    return lambda file: file[path].__setitem__(..., value)


def linked(path, link):
    return lambda file: (file.pop(path), file.__setitem__(path, link))


def enormous(file):
    """72 TiB that are only declared."""
    del file["study/e_n/ccm"]
    file.create_dataset("study/e_n/ccm", (10**13,), "<f8", chunks=(10**5,))


def no_numbers(file):
    for group in file["study"].values():
        for node in group.values() if isinstance(group, h5py.Group) else ():
            if isinstance(node, h5py.Dataset) and node.dtype.kind == "f" and "CLASS" not in node.attrs:
                node[...] = np.nan


def text(name, content):
    def spoil(file):
        raw = content.encode("utf-8", "surrogatepass")
        put(file, f"study/{name}", np.array(raw, h5py.string_dtype("utf-8", max(len(raw), 1))))

    return spoil


def words(file):
    file["study"].attrs["title"] = EVIL
    header = json.loads(file["study/header"][()])
    text("header", json.dumps(header | {"title": EVIL, "labels": [EVIL] * len(header["labels"])}))(file)
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
DERIVED = {"name": "x", "dims": [], "unit": "", "label": "", "definition": "", "group": "derived"}
DEEP = "[" * 100_000
LIES = {
    "soft link to nothing": linked("study/e_n/ccm", h5py.SoftLink("/nowhere")),
    "enormous map": enormous,
    "recursive group": lambda file: file.__setitem__("study/e_n/again", file["study"]),
    "a map of texts": data("study/e_n/ccm", np.array(["a", "b"], object)),
    "a group for a map": lambda file: (file["study/e_n"].pop("ccm"), file.create_group("study/e_n/ccm")),
    "no maps": lambda file: file["study"].pop("e_n"),
    "no status": lambda file: file["study"].pop("status"),
    "no study": lambda file: file.pop("study"),
    "NaN axis": values("study/axes/station", np.nan),
    "zero axis": values("study/axes/normal_force", 0.0),
    "axis of two dimensions": data("study/axes/station", np.zeros((5, 1))),
    "axes that do not exist": options(axes=[{"name": n, "values": [0], "units": "", "long_name": n} for n in "abc"]),
    "axes elsewhere": options(axes=[{"name": n, "values": [0], "units": "", "long_name": n} for n in ("..", ".", "/")]),
    "axes of texts": options(axes=[{"name": n, "values": ["x"], "units": "", "long_name": n} for n in "abc"]),
    "units that are words": attribute("study/axes/station", "units", "furlong"),
    "a layout that is deep": text("layout", DEEP),
    "patches that are not there": options(faces=10**6),
    "derived elsewhere": options(derived=[{**DERIVED, "name": "../../x"}]),
    "two meshes": options(has=["two meshes"]),
    "states that do not exist": values("study/status/code", 7),
    "NaN everywhere": no_numbers,
    "scene that is deep": text("scene", "a = " + DEEP),
    "scene with orders": text("scene", SCENE + '[output]\nfile = "../../x.hdf"\n'),
    "scene of a mesh": text("scene", '[object]\nshape = "mesh"\nmesh = "/etc/passwd.stl"\nunit = "mm"\n' + SCENE[43:]),
    "words with orders": words,
}  # fmt: skip
