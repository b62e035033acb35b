"""Mesh files that ask for more than they hold: huge counts, circles, doublings, bombs and other people's files."""

import json

from tests.fuzz.readers import glb, gltf, gltf_tree, model_3mf, packed

HUGE = 10**12
DEEP = 40  # doublings: 2^40 bodies
ACCESSORS = {"huge count": {"count": HUGE}, "negative count": {"count": -1}, "far offset": {"byteOffset": HUGE}}
PLACES = {"other file": "../../../etc/passwd", "absolute": "/etc/passwd", "device": "/dev/zero",
          "network": "http://127.0.0.1:9/buffer.bin"}  # fmt: skip
CIRCLE = (
    '<object id="2" type="model"><components><component objectid="3"/></components></object>'
    '<object id="3" type="model"><components><component objectid="2"/></components></object>'
)
ENTITIES = "<!DOCTYPE m [" + '<!ENTITY a "' + "x" * 100 + '">' + "".join(
    f'<!ENTITY {new} "{f"&{old};" * 10}">' for old, new in zip("abcdefghij", "bcdefghijk", strict=True)
) + "]>"  # fmt: skip
FILE = '<!DOCTYPE m [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
ZEROS = bytes(300 * 2**20)
LINES = {
    "a.ply": b"ply\nformat ascii 1.0\nelement vertex 999999999999\nproperty float x\nelement face 1\nend_header\n",
    "b.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\nproperty float y\n"
             b"property float z\nelement face 2000000000\nproperty list uint int vertex_indices\nend_header\n"
             + b"\xff" * 99,
    "a.off": b"OFF\n4000000000 4000000000 0\n0 0 0\n",
    "a.stl": bytes(80) + b"\xff\xff\xff\xff" + bytes(500),
    "a.obj": b"v 0 0 0\n" * 3 + b"f " + b"1 2 3 " * 200_000,
    "b.obj": b"mtllib /etc/passwd\n" + b"v 0 0 0\n" * 3 + b"f 1 2 999999999\n",
}  # fmt: skip


def accessors(**changes):
    return [accessor | changes for accessor in gltf_tree()["accessors"]]


def doublings(count=DEEP):
    """Objects of a 3MF file, each of which has the one before twice."""
    pair = '<component objectid="{0}"/><component objectid="{0}"/>'
    return "".join(
        f'<object id="{i + 1}" type="model"><components>{pair.format(i)}</components></object>' for i in range(1, count)
    )


def hostile():
    """Bytes by the name of a file; made when they are asked for, because some are large."""
    circle = [{"mesh": 0, "children": [1]}, {"children": [0]}]
    twice = [{"children": [i + 1, i + 1]} for i in range(DEEP)] + [{"mesh": 0}]
    fan = [{"children": list(range(1, 5000))}, *({"mesh": 0} for _ in range(4999))]
    files = {
        **{f"{name}.gltf": gltf(accessors=accessors(**change)) for name, change in ACCESSORS.items()},
        "huge count.glb": glb(accessors=accessors(count=HUGE)),
        "long view.glb": glb(bufferViews=[{"buffer": 0, "byteOffset": 0, "byteLength": HUGE}] * 2),
        "sparse.gltf": gltf(accessors=[{"componentType": 5126, "count": 4 * 10**7, "type": "MAT4"}] * 2),
        "circle.gltf": gltf(nodes=circle), "circle.glb": glb(nodes=circle),
        "itself.gltf": gltf(nodes=[{"mesh": 0, "children": [0]}]),
        "doublings.gltf": gltf(nodes=twice), "many places.gltf": gltf(nodes=fan),
        "deep.gltf": b'{"asset":' + b"[" * 100_000 + b"]" * 100_000 + b"}",
        **{f"{name}.gltf": gltf(buffers=[{"byteLength": 168, "uri": uri}]) for name, uri in PLACES.items()},
        "numbers.gltf": json.dumps(gltf_tree()).replace("72", "1e400").encode(),
        "bomb.3mf": packed(ZEROS), "bombs.3mf": packed(model_3mf(), *[ZEROS[: 50 * 2**20]] * 6),
        "circle.3mf": packed(model_3mf(CIRCLE, 2)),
        "itself.3mf": packed(model_3mf(CIRCLE.replace("3", "2"), 2)),
        "doublings.3mf": packed(model_3mf(doublings(), DEEP)),
        "entities.3mf": packed(model_3mf(head=ENTITIES).replace(b"30", b"&k;", 1)),
        "other file.3mf": packed(model_3mf(head=FILE).replace(b"30", b"&a;", 1)),
        "empty.3mf": packed(),
        "nested.3mf": packed(model_3mf("<metadata>" * 50_000 + "</metadata>" * 50_000)),
    }  # fmt: skip
    return files | LINES
