"""Limit surfaces in a report: rebuilt from what a file holds, shown as shadows."""

import numpy as np
import pytest

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.lsfit.form import exponents, monomials
from softjaw.lsfit.surface import circle, shadow_outline
from softjaw.study.quantities import MONOMIALS
from softjaw.study.ranking import judge
from softjaw.study.result.layout import Layout
from softjaw.study.result.read import open
from softjaw.study.show.grasps import field
from softjaw.study.show.report.contact import limit_surfaces
from softjaw.study.show.stored_surface import stored_surface
from softjaw.study.show.view.model import View
from tests.lsfit.test_surfaces import squared
from tests.study.show.test_report import axes, make, patch

MU, RHO = 0.5, 0.02
S = float((patch()["pressure"] * patch()["area"])[0].sum())
SEMI = np.array([1.0, 0.9, 0.3])
BODY = squared(np.diag(SEMI**-2))  # an ellipsoid as a quartic


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """Two stations whose contacts carry the patch of the report's tests, and a quartic that is an ellipsoid."""
    scale = np.array([1.0, 1.0, RHO])
    values = {
        "limit_surface/semi_axes": np.broadcast_to(MU * SEMI * scale, (2, 3, 3)),
        "limit_surface/rho": [RHO, RHO], "fingers/S": [S, S], "fingers/f_x_max": np.full((2, 3), MU * S),
        "limit_surface/coefficients": np.broadcast_to(BODY.coefficients, (2, 3, 15)),
        "fingers/tau_z_max": np.full((2, 3), 0.01), "maps/overclaim": 0.002, "maps/overclaim_ellipsoid": 0.013,
    }  # fmt: skip
    layout = Layout(axes(stations=(0.0, 0.01), angles=(0.0,), forces=(1.0,)), 24)
    return make(tmp_path_factory.mktemp("surface") / "s.hdf", layout, **values)


def test_monomials_are_named_in_the_order_of_the_fits():
    w = {"x": 2.0, "y": 3.0, "t": 5.0}
    named = [np.prod([w[f[0]] ** int(f[2:] or 1) for f in name.split()]) for name in MONOMIALS]
    assert monomials(np.array([[*w.values()]]), exponents(3, 4))[0] == pytest.approx(named)


@pytest.mark.parametrize(("i", "j"), [(0, 1), (0, 2), (1, 2)])
def test_shadows_of_ellipsoids_are_ellipses(i, j):
    for surface in (Ellipsoid.of_axes(SEMI), BODY):
        outline = shadow_outline(surface.support_points, i, j, 120)
        assert ((outline / SEMI[[i, j]]) ** 2).sum(axis=1) == pytest.approx(1.0, rel=1e-7)


def test_surfaces_and_exact_wrenches_are_rebuilt_from_the_file_and_shown(file):
    data = judge(open(file))
    faces = View(data).faces((1, 0, 0))
    flat, curved = (stored_surface(data, (1, 0, 0), 1, model, faces) for model in ("pcm", "ccm"))
    assert flat.unit == pytest.approx(MU * S * np.array([1.0, 1.0, 1e3 * RHO]))
    assert flat.ellipsoid.semi_axes == pytest.approx(SEMI)
    assert flat.chosen.radius(np.eye(3)) == pytest.approx(SEMI)
    # a plane contact slides alike in every direction, and turning it takes no more than all its load at the rim
    sliding = flat.exact.support_points(circle(0, 1, 24))
    assert np.linalg.norm(sliding[:, :2], axis=1) == pytest.approx(1.0, rel=1e-9)
    assert shadow_outline(flat.exact.support_points, 0, 1, 90)[:-1] == pytest.approx(circle(0, 1, 90)[:, :2], abs=1e-9)
    assert 0 < flat.exact.semi_axes[2] * RHO < 0.01 * np.sqrt(2)
    assert curved.exact.semi_axes[:2].max() <= 1 + 1e-12
    shown = limit_surfaces(View(data), (0, 0, 0))["figure"].data
    outlines = [trace for trace in shown if trace.mode == "lines" and trace.line.dash == "solid"]
    assert len(outlines) == 2 * 3  # CCM and PCM
    reach = MU * S * SEMI * [1, 1, 1e3 * RHO]
    for trace in outlines[:2]:
        assert [np.abs(a).max() for a in (trace.x, trace.y)] == pytest.approx(reach[:2], rel=1e-6)
    assert sum(trace.type == "scatter" and trace.mode == "markers" for trace in shown) == 2 * 3


def test_a_file_without_patches_has_the_surfaces_alone_and_one_without_fits_has_no_figure(tmp_path, file):
    layout = Layout(axes(stations=(0.0,), angles=(0.0,), forces=(1.0,)), 0)
    data = judge(open(file))
    names = ("semi_axes", "rho", "coefficients")
    values = {f"limit_surface/{n}": field(data, f"limit_surface_{n}")[0, 0, 0] for n in names}
    values |= {f"fingers/{n}": field(data, f"finger_{n}")[0, 0, 0] for n in ("S", "f_x_max")}
    bare = judge(open(make(tmp_path / "bare.hdf", layout, **values)))
    shown = limit_surfaces(View(bare), (0, 0, 0))["figure"].data
    assert not any(trace.mode == "markers" for trace in shown if trace.type == "scatter")
    assert limit_surfaces(View(judge(open(make(tmp_path / "none.hdf", layout)))), (0, 0, 0)) is None
