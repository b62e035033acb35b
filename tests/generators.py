"""Contact patches and meshes with known shapes, shared by the tests of friction, limit surfaces and scores.

Faces sit at the midpoints of a regular grid of parameters; the pressure is taken at the face centre. A table case names
a generator of `PATCHES` with its arguments and a pressure of `PRESSURES`.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import REST


def cor_twists(cor):
    """Unit rotations about axes along z through the centres ``(m, 2)``: ``[c_y, -c_x, 1]``."""
    c = np.asarray(cor, float).reshape(-1, 2)
    return np.column_stack([c[:, 1], -c[:, 0], np.ones(len(c))])


def cor_grid(n, rho):
    """The paper's grid: ``n x n`` centres of rotation on the square with side ``10 rho``."""
    c = np.linspace(-5 * rho, 5 * rho, n)
    return cor_twists(np.stack(np.meshgrid(c, c, indexing="ij"), axis=-1))


def _mid(lower, upper, n):
    return lower + (np.arange(n) + 0.5) * (upper - lower) / n


def _grid(u, v):
    return (g.ravel() for g in np.meshgrid(u, v, indexing="ij"))


def _patch(r, a, n, p=None, corners=None):
    shape = len(r)
    n = np.broadcast_to(n, (shape, 3))
    return ContactPatch(r, np.broadcast_to(a, shape), n, np.ones(shape) if p is None else p, corners)


def rect_grid(a, b, nx, ny):
    x, y = _grid(_mid(-a / 2, a / 2, nx), _mid(-b / 2, b / 2, ny))
    return _patch(np.column_stack([x, y, 0 * x]), a * b / (nx * ny), [0, 0, 1])


def disc_polar(R, nr, nt, b=None):
    b = R if b is None else b
    s, th = _grid(_mid(0, 1, nr), _mid(0, 2 * np.pi, nt))
    r = np.column_stack([R * s * np.cos(th), b * s * np.sin(th), 0 * s])
    return _patch(r, R * b * s / nr * 2 * np.pi / nt, [0, 0, 1])


def cylinder_grid(R, alpha, L, nphi, nx):
    phi, x = _grid(_mid(-alpha, alpha, nphi), _mid(-L / 2, L / 2, nx))
    n = np.column_stack([0 * phi, np.sin(phi), np.cos(phi)])
    return _patch(np.column_stack([x, R * np.sin(phi), R * (np.cos(phi) - 1)]), R * 2 * alpha / nphi * L / nx, n)


def ellcyl_grid(a, b, tmax, L, nt, nx):
    t, x = _grid(_mid(-tmax, tmax, nt), _mid(-L / 2, L / 2, nx))
    g = np.hypot(b * np.cos(t), a * np.sin(t))
    n = np.column_stack([0 * t, a * np.sin(t), b * np.cos(t)]) / g[:, None]
    return _patch(np.column_stack([x, b * np.sin(t), a * (np.cos(t) - 1)]), g * 2 * tmax / nt * L / nx, n)


def cap_polar(R, alpha, nth, nphi):
    t, phi = _grid(_mid(0, alpha, nth), _mid(0, 2 * np.pi, nphi))
    n = np.column_stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)])
    dt = alpha / nth
    return _patch(R * n - [0, 0, R], R**2 * (np.cos(t - dt / 2) - np.cos(t + dt / 2)) * 2 * np.pi / nphi, n)


def heightfield(A, B, kx, ky, nx, ny):
    x, y = _grid(_mid(-A, A, nx), _mid(-B, B, ny))
    n = np.column_stack([kx * x, ky * y, 1 + 0 * x])
    g = np.linalg.norm(n, axis=1)
    return _patch(np.column_stack([x, y, -(kx * x**2 + ky * y**2) / 2]), g * 4 * A * B / (nx * ny), n)


def wedge(beta, W, L, nw, nx):
    u, x = _grid(_mid(0, W, nw), _mid(-L / 2, L / 2, nx))
    s, c = np.sin(beta), np.cos(beta)
    r = np.vstack([np.column_stack([x, side * u * c, -u * s]) for side in (1, -1)])
    n = np.vstack([np.tile([0, side * s, c], (len(u), 1)) for side in (1, -1)])
    return _patch(r, W * L / (nw * nx), n)


def points_patch(r, f, n=(0, 0, 1)):
    r = np.asarray(r, float)
    return _patch(np.pad(r, ((0, 0), (0, 3 - r.shape[1]))), 1.0, np.asarray(n, float), np.asarray(f, float))


def lcg(seed) -> Iterator[float]:
    """Uniform numbers in [0, 1) of the 64-bit linear congruential generator of Knuth's MMIX."""
    state = seed
    while True:
        state = (6364136223846793005 * state + 1442695040888963407) % 2**64
        yield (state >> 11) / 2**53


def lcg_noise(K, amplitude, seed):
    """Factors ``1 + amplitude (2 u - 1)``, one per sample."""
    draw = lcg(seed)
    return 1 + amplitude * (2 * np.array([next(draw) for _ in range(K)]) - 1)


def lcg_sphere(d, K, seed):
    """Random unit vectors ``(K, d)``: normal numbers by Box and Muller, two draws for each."""
    draw = lcg(seed)
    u = np.array([next(draw) for _ in range(2 * K * d)]).reshape(K, d, 2)
    x = np.sqrt(-2 * np.log(1 - u[..., 0])) * np.cos(2 * np.pi * u[..., 1])
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def lcg_patch(seed, N, slope=0.8):
    draw = lcg(seed)
    x, y, sx, sy, a, p = np.array([[next(draw) for _ in range(6)] for _ in range(N)]).T
    x, y, sx, sy = 2 * x - 1, 2 * y - 1, slope * (2 * sx - 1), slope * (2 * sy - 1)
    r = np.column_stack([x, y, -(sx * x + sy * y) / 2])
    return _patch(r, 0.01 * (0.5 + a), np.column_stack([sx, sy, 1 + 0 * x]), 2 * p)


MADE = rect_grid, disc_polar, cylinder_grid, ellcyl_grid, cap_polar, heightfield, wedge, points_patch, lcg_patch
PATCHES = {f.__name__: f for f in MADE}


def _ellipse(r, a, b=None):
    return np.maximum(0, 1 - (r[:, 0] / a) ** 2 - (r[:, 1] / (a if b is None else b)) ** 2)


PRESSURES = {
    "uniform": lambda r: np.ones(len(r)),
    "hertz": lambda r, a, b=None: np.sqrt(_ellipse(r, a, b)),
    "parab": _ellipse,
    "lin": lambda r, gx=0.0, gy=0.0: np.maximum(0, 1 + gx * r[:, 0] + gy * r[:, 1]),
    "gauss": lambda r, x0, y0, sx, sy: np.exp(-(((r[:, 0] - x0) / sx) ** 2 + ((r[:, 1] - y0) / sy) ** 2) / 2),
    "depth": lambda r, h: np.maximum(0, 1 + r[:, 2] / h),
    "hertzdepth": lambda r, h: np.sqrt(np.maximum(0, 1 + r[:, 2] / h)),
}


def build(spec):
    """Patch of a table entry ``{gen, args, pressure, shift_to_cop_xy}``."""
    patch = PATCHES[spec["gen"]](**spec["args"])
    if "pressure" in spec:
        field = dict(spec["pressure"])
        kind, p0 = field.pop("kind"), field.pop("p0", 1.0)
        patch = replace(patch, pressure=p0 * PRESSURES[kind](patch.centroid, **field))
    if spec.get("shift_to_cop_xy"):
        cop = patch.load @ patch.centroid / patch.load.sum()
        patch = replace(patch, centroid=patch.centroid - [cop[0], cop[1], 0])
    return patch


def mesh_patch(corners, pressure=None):
    """Patch of triangles ``(n, 3, 3)`` or quadrilaterals ``(n, 4, 3)``; the order of the corners gives the side."""
    q = np.asarray(corners, float)
    triangle = q.shape[1] == 3
    n = np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]) if triangle else np.cross(q[:, 2] - q[:, 0], q[:, 3] - q[:, 1])
    r = q.mean(axis=1)
    return _patch(r, np.linalg.norm(n, axis=1) / 2, n, None if pressure is None else pressure(r), q)


def _quads(vertex, order):
    i, j = _grid(np.arange(vertex.shape[0] - 1), np.arange(vertex.shape[1] - 1))
    return np.stack([vertex[i + di, j + dj] for di, dj in order], axis=1)


def cyl_mesh(R, alpha, L, nphi, nx, shift=0.0, tri=False):
    phi, x = -alpha + shift + 2 * alpha * np.arange(nphi + 1) / nphi, -L / 2 + L * np.arange(nx + 1) / nx
    P, X = np.meshgrid(phi, x, indexing="ij")
    vertex = np.stack([X, R * np.sin(P), R * (np.cos(P) - 1)], axis=-1)
    quad = _quads(vertex, [(0, 0), (0, 1), (1, 1), (1, 0)])
    return np.stack([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]], axis=1).reshape(-1, 3, 3) if tri else quad


def grid_mesh(n, m, halfx, halfy, height=lambda x, y: 0 * x):
    """Quadrilaterals over a rectangle; plane, or bumpy with ``height``."""
    X, Y = np.meshgrid(np.linspace(-halfx, halfx, n + 1), np.linspace(-halfy, halfy, m + 1), indexing="ij")
    return _quads(np.stack([X, Y, height(X, Y)], axis=-1), [(0, 0), (1, 0), (1, 1), (0, 1)])


def bump(x, y):
    return -0.25 * (x**2 + y**2) + 0.08 * np.sin(3 * x + 0.5) * np.cos(2 * y)


def moved(patch, rotation, translation):
    R, t = np.asarray(rotation, float), np.asarray(translation, float)
    corners = None if patch.corners is None else patch.corners @ R.T + t
    return replace(patch, centroid=patch.centroid @ R.T + t, normal=patch.normal @ R.T, corners=corners)


def screw_twist(axis, point, pitch):
    """Unit screws as 6-D twists: ``omega = e``, ``v = h e + e x (O - q)``; an infinite pitch: translation ``e``."""
    e = np.atleast_2d(np.asarray(axis, float))
    e = e / np.linalg.norm(e, axis=1, keepdims=True)
    q, h = np.broadcast_to(np.asarray(point, float), e.shape), np.broadcast_to(np.asarray(pitch, float), len(e))
    straight = np.isinf(h)[:, None]
    v = np.where(straight, e, np.where(straight, 0.0, h[:, None]) * e - np.cross(e, q))
    return np.hstack([v, np.where(straight, 0.0, e)])


def friction_sums_reference(arm, normal, load, twist):
    """What the compiled kernel sums, written as the textbook formula: force, torque, dissipation, ``(m, 7)``."""
    r, n = arm.T, normal.T
    rows = []
    for t in twist:
        v = t[:3] + np.cross(t[3:], r)
        slip = v - (v * n).sum(axis=1, keepdims=True) * n
        speed = np.linalg.norm(slip, axis=1)
        f = np.divide(load, speed, out=np.zeros_like(load), where=speed > REST)[:, None] * slip
        rows.append([*f.sum(axis=0), *np.cross(r, f).sum(axis=0), (load * speed).sum()])
    return np.array(rows)
