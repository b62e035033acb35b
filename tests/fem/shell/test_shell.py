"""The shell element: rigid motions, tangent, patch tests, plates, tapered walls, triangles at a disc's middle."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.spatial.transform import Rotation

from softjaw.fem.shell.element import Shell, ShellMesh, grid_elements, patch
from softjaw.fem.shell.wall_model import LinearShell, middles

E, NU, THICKNESS = 2e9, 0.38, 0.02
RNG = np.random.default_rng(7)
TURN = Rotation.random(random_state=7).as_matrix()
INNER = [[0.04, 0.02], [0.18, 0.03], [0.16, 0.08], [0.08, 0.08]]
CORNERS = [[0, 0], [0.24, 0], [0.24, 0.12], [0, 0.12]]
RING = [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7]]


def warped(n=3):
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1.2, n + 1), indexing="ij")
    x[1:-1, 1:-1] += RNG.uniform(-0.08, 0.08, (n - 1, n - 1))
    y[1:-1, 1:-1] += RNG.uniform(-0.08, 0.08, (n - 1, n - 1))
    normal = np.stack([-0.4 * x - 0.1 * y, -0.1 * x, 1 + 0 * x], -1)
    normal /= np.linalg.norm(normal, axis=-1)[..., None]
    return patch(np.stack([x, y, 0.2 * x**2 + 0.1 * x * y], -1), normal, THICKNESS)


def disc(n, radius, thickness, quarter=False):
    turns = np.linspace(0, np.pi / 2 if quarter else 2 * np.pi, (n if quarter else 4 * n) + 1)
    r, t = np.meshgrid(np.linspace(0, radius, n + 1), turns, indexing="ij")
    number = np.arange(r.size).reshape(r.shape)
    number[0] = 0
    if not quarter:
        number[:, -1] = number[:, 0]
    kept, number = np.unique(number, return_inverse=True)
    X = np.stack([r * np.cos(t), r * np.sin(t), 0 * r], -1).reshape(-1, 3)[kept]
    number = number.reshape(r.shape)
    return ShellMesh(X, np.tile([0, 0, thickness / 2], (len(X), 1)), grid_elements(number)), number


def dense(shell, q=None, before=None):
    values = shell.tangent(np.zeros(shell.size) if q is None else q, before)
    return csr_matrix((values, shell.column, shell.start), shape=(shell.size,) * 2).toarray()


@pytest.mark.parametrize("mesh", [warped(1), warped(3), disc(2, 1.0, THICKNESS)[0]], ids=["element", "patch", "disc"])
def test_exactly_six_motions_need_no_force_small_ones_and_rotations(mesh):
    K = dense(Shell(mesh, E, NU))
    assert np.abs(K - K.T).max() < 1e-15 * np.abs(K).max()
    values = np.linalg.eigvalsh(K)
    assert np.abs(values[:6]).max() < 1e-14 * values[-1]
    assert values[6] > 1e-9 * values[-1]
    q = np.hstack([mesh.X @ (TURN - np.eye(3)).T + [1, 2, 3], mesh.D @ (TURN - np.eye(3)).T]).ravel()
    assert np.abs(Shell(mesh, E, NU).residual(q)).max() < 2e-13 * E * THICKNESS


def test_the_tangent_is_the_derivative_of_the_force_the_mixed_one_with_the_stress_of_the_last_linear_step():
    stiffness = RNG.normal(size=(9, 9))
    shell = Shell(warped(), E, NU, (np.array([2, 3, 11]), 1e6 * stiffness @ stiffness.T))
    q, p, h = 1e-2 * RNG.normal(size=shell.size), RNG.normal(size=shell.size), 1e-5
    near, far = (shell.residual(q + k * h * p) - shell.residual(q - k * h * p) for k in (1, 2))
    expected = (8 * near - far) / (12 * h)
    assert np.abs(dense(shell, q) @ p - expected).max() < 1e-9 * np.abs(expected).max()
    # It lacks the quadratic share of the step's strain, which is even in the step and grows as its square.
    start, step = np.zeros(shell.size), 1e-2 * RNG.normal(size=shell.size)
    one, other, double = (dense(shell, k * step, start) - dense(shell, k * step) for k in (1, -1, 2))
    assert np.abs(one).max() > 1e-3 * np.abs(dense(shell)).max()
    assert np.abs(one - other).max() < 1e-12 * np.abs(one).max()
    assert np.abs(double - 4 * one).max() < 1e-12 * np.abs(double).max()
    assert np.abs(dense(shell, step, step) - dense(shell, step)).max() == 0


def solved_patch(prescribed):
    """Inner nodes' numbers solved for, with the corners' prescribed ``(8, 6)``."""
    x, y = np.array(CORNERS + INNER).T
    mesh = ShellMesh(np.stack([x, y, 0 * x], 1), np.tile([0, 0, 5e-4], (8, 1)), np.array(RING, dtype=np.int32))
    shell, exact = Shell(mesh, 1e6, 0.25), prescribed(x, y)
    K, q = dense(shell), np.zeros(48)
    q[:24] = exact.ravel()[:24]
    q[24:] = np.linalg.solve(K[24:, 24:], -K[24:, :24] @ q[:24])
    return shell, q, exact.ravel()


def test_membrane_and_bending_patches_are_exact():
    """Constant stresses 1333, 1333, 400 from u = 1e-3 (x + y/2), v = 1e-3 (y + x/2)."""

    def stretched(x, y):
        z = 0 * x
        return 1e-3 * np.stack([x + y / 2, y + x / 2, z, z, z, z], 1)

    shell, q, exact = solved_patch(stretched)
    assert np.abs(q - exact).max() < 1e-15 * 0.24
    stress = 1e4 * middles(shell, 1e-4 * q)[0].stress  # small enough for the squares of the strains to vanish
    middle, half = 0.5 * (stress[..., 0] + stress[..., 1]), 0.5 * (stress[..., 0] - stress[..., 1])
    assert middle == pytest.approx(1e3 / 0.75, rel=1e-6)
    assert half**2 + stress[..., 2] ** 2 == pytest.approx(400**2, rel=1e-6)
    # Constant moments from w = 1e-3 (x^2 + x y + y^2) / 2; directors stay at right angles.
    def bent(x, y):
        z = 0 * x
        slope = 5e-4 * 1e-3 * np.stack([x + y / 2, y + x / 2], 1)
        return np.column_stack([z, z, 0.5e-3 * (x * x + x * y + y * y), -slope, z])

    shell, q, exact = solved_patch(bent)
    assert np.abs(q - exact).max() < 1e-11 * np.abs(exact).max()
    outer, inner = middles(shell, q)
    stress = 0.5 * (outer.stress - inner.stress)
    # E t/2 (kappa_x + nu kappa_y) / (1 - nu^2), compressed on the side to which it curves: 0.667 and shear 0.2
    middle, half = 0.5 * (stress[..., 0] + stress[..., 1]), 0.5 * (stress[..., 0] - stress[..., 1])
    assert middle == pytest.approx(-2 / 3, rel=1e-6)
    assert half**2 + stress[..., 2] ** 2 == pytest.approx(0.2**2, rel=1e-5)


def test_clamped_disc_with_triangles_in_the_middle():
    """Middle of a clamped plate under uniform pressure: p a^4 / (64 D), and the thickness' shear p a^2 / (4 k G t)."""
    a, t, p, exact = 0.05, 0.0005, 100.0, None
    exact = p * a**4 * 12 * (1 - NU**2) / (64 * E * t**3) + p * a**2 / (4 * 5 / 6 * E / (2 + 2 * NU) * t)
    errors = []
    for n in (8, 16):
        mesh, number = disc(n, a, t, quarter=True)
        shell = Shell(mesh, E, NU)
        fixed = np.zeros((len(mesh.X), 6), bool)
        fixed[number[-1]] = True
        for axis, line in ((1, number[:, 0]), (0, number[:, -1])):
            fixed[line, axis] = fixed[line, 3 + axis] = True
        load = np.zeros((len(mesh.X), 6))
        load[:, 2] = p * shell.node_area
        q = LinearShell(shell, fixed.ravel()).solve(load.ravel())
        errors.append(abs(q[6 * number[0, 0] + 2] / exact - 1))
    assert errors[1] < 0.006
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.3)


def test_a_tapered_strip_bends_as_a_beam_and_elements_that_are_none_are_refused():
    """Tip of a cantilever whose thickness grows evenly to twice: w = int P x^2 / (E I(x)) dx."""
    n, L, t, P = 40, 0.2, 0.001, 0.01
    x, y = np.meshgrid(np.linspace(0, L, n + 1), [0, 0.01], indexing="ij")
    h = t * (1 + x / L)  # from the free end to the clamped one
    mesh = ShellMesh(
        np.stack([x, y, 0 * x], -1).reshape(-1, 3), np.stack([0 * x, 0 * x, h / 2], -1).reshape(-1, 3),
        grid_elements(np.arange(x.size).reshape(x.shape)),
    )
    shell = Shell(mesh, E, 0.0)
    fixed, load = np.zeros((2 * n + 2, 6), bool), np.zeros((2 * n + 2, 6))
    fixed[-2:], load[:2, 2] = True, P / 2
    q = LinearShell(shell, fixed.ravel()).solve(load.ravel()).reshape(-1, 6)
    # int x^2 / (1 + x/L)^3 dx = L^3 (ln 2 - 5/8)
    exact = 12 * P * L**3 * (np.log(2) - 0.625) / (E * 0.01 * t**3)
    assert q[0, 2] == pytest.approx(exact, rel=2e-3)
    x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    up = np.tile([0, 0, 0.01], (4, 1))
    with pytest.raises(ValueError, match="element 0"):
        Shell(ShellMesh(x, up, np.array([[0, 3, 2, 1]], dtype=np.int32)), E, NU)
