"""Limit surfaces, general poses and the task in the pipeline, on coarse meshes; judged by what each case stores."""

import numpy as np
import pytest

import softjaw as sj
from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.lsfit.form import exponents, monomials
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.samples import sphere_motions
from softjaw.lsfit.surface import FitError
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.pose import pose_volume
from softjaw.study.case import limit_surface
from softjaw.study.case.limit_surface import AS_FITTED, ELLIPSOID, INDEPENDENT, PROGRAMME, STANDS_IN
from softjaw.study.flags import Flag
from softjaw.study.quantities import MODELS
from tests.study.scenes import OVAL
from tests.study.test_pipeline import CURVED, FLAT, MU, PLATE, cases, solved

WEIGHT = 9.80665
EXTENTS = [0.05, 0.04, 0.12]  # of OVAL [m]


def exact(result, f, model, count):
    """Wrenches ``(f_x, f_y, tau_z / rho) / S`` of a finger for ``count`` motions, from the case's patch."""
    values, patch = result.values, result.patch
    R, origin = values["fingers/frame_axes"][f], values["fingers/frame_origin"][f]
    local = ContactPatch(
        (patch["centroid"][f] - origin) @ R.T, patch["area"][f], patch["normal"][f] @ R.T, patch["pressure"][f]
    )
    rho = values["limit_surface/rho"][f]
    w = friction_wrench(local, fibonacci_twists(count, rho), 1.0, model)[:, [0, 1, 5]]
    return w / values["fingers/S"][f] / [1, 1, rho]


@pytest.mark.parametrize("angle", [0, 30])
def test_stored_quartics_pass_the_wrenches_of_the_stored_patch_as_closely_as_their_fit_error_says(angle):
    [(_, path)] = solved(OVAL, angles=f"[{angle}]")
    for result in path:
        values = result.values
        for f in range(2):
            for m, model in enumerate(MODELS):
                W = exact(result, f, model, INDEPENDENT)
                P = monomials(W, exponents(3, 4)) @ values["limit_surface/coefficients"][f][m]
                E1, radial, angle_error = values["limit_surface/fit_error"][f][m]
                assert np.abs(P - 1).mean() == pytest.approx(E1, rel=1e-6)
                assert np.abs(P**-0.25 - 1).mean() == pytest.approx(radial, rel=1e-6)
                assert 0 < angle_error < np.radians(10)
                assert values["limit_surface/certificate"][f][m] in (AS_FITTED, PROGRAMME)
                assert np.isnan(values["limit_surface/matrix"][f][m]).all()
        curved = [values["limit_surface/fit_error"][f][CURVED].Erad for f in range(2)]
        assert values["maps/fit_error"] == max(curved)
        assert values["maps/fit_error"] < 0.7 * values["maps/fit_error_ellipsoid"]
        # the ellipsoid from three motions lies outside of most of the true surface
        assert (np.array(values["maps/quality_fitted"]) < np.array(values["maps/quality"])).all()
        assert result.effects["limit_surface"][:2] == ("convex quartic", values["maps/fit_error"])


@pytest.mark.parametrize(("model", "objective"), [
    ("three_motions", "least_squares"), ("axis_aligned", "least_squares"), ("full", "least_squares"), ("full", "zhou"),
    ("quartic", "zhou"),
])  # fmt: skip
def test_every_model_and_objective_gives_a_surface_near_the_wrenches(model, objective):
    choice = (f"limit_surface.model={model}", f"limit_surface.objective={objective}", "limit_surface.samples=100")
    [(_, [result])] = solved(OVAL, *choice, forces="[5]")
    values = result.values
    assert 0 < values["maps/fit_error"] < 0.03
    if model == "quartic":
        assert np.isfinite(values["limit_surface/coefficients"]).all()
        assert (np.array(values["limit_surface/certificate"]) == PROGRAMME).all()
        return
    assert (np.array(values["limit_surface/certificate"]) == ELLIPSOID).all()
    matrix = np.array(values["limit_surface/matrix"])
    W = exact(result, 0, "ccm", INDEPENDENT)
    P = np.einsum("mi,ij,mj->m", W, matrix[0, CURVED], W)
    assert np.abs(P**-0.5 - 1).mean() == pytest.approx(values["maps/fit_error"], rel=1e-6)
    if model == "three_motions":
        assert values["maps/fit_error"] == values["maps/fit_error_ellipsoid"]
        assert values["maps/quality_fitted"] == pytest.approx(values["maps/quality"], rel=1e-9)


def test_a_fit_that_fails_leaves_the_ellipsoid_and_a_flag(monkeypatch):
    def fail(*samples):
        raise FitError("stopped")

    monkeypatch.setattr(limit_surface, "convex_quartic", fail)
    solved.cache_clear()
    [(_, [result])] = solved(OVAL, "limit_surface.samples=60", forces="[5]")
    solved.cache_clear()
    assert (np.array(result.values["limit_surface/certificate"]) == STANDS_IN).all()
    assert result.values["maps/flags"] & Flag.NO_FIT
    assert Flag.NO_FIT.sentence in result.message
    assert result.values["maps/fit_error"] == result.values["maps/fit_error_ellipsoid"]
    monkeypatch.undo()
    assert not cases(OVAL, "limit_surface.samples=60", forces="[5]")[0]["maps/flags"] & Flag.NO_FIT


def soft_contacts(values, m):
    """Contacts with the ellipsoids from three motions, from what a case stores."""
    for f in range(2):
        R = values["fingers/pose_rotation"][f]
        position = R @ values["fingers/frame_origin"][f] + values["fingers/pose_origin"][f]
        body = Ellipsoid.of_axes(values["limit_surface/semi_axes"][f][m])
        yield SoftContact(position, values["fingers/frame_axes"][f] @ R.T, body)


def test_contacts_that_do_not_face_each_other_are_scored_as_they_stand_and_epsilon_on_demand():
    """Arms over the object's extents, torques over the pad's length; the closed form would be off by some percent."""
    for values in cases(OVAL, angles="[30]"):
        assert values["maps/misalignment"] > np.radians(5)
        for m in range(len(MODELS)):
            expected = pose_volume(*soft_contacts(values, m), EXTENTS, 0.05, relative_error=1e-6).linf
            assert values["maps/quality"][m] == pytest.approx(expected, rel=1e-4)
        assert np.isnan(values["maps/epsilon"]).all()
    far, near = (cases(OVAL, angles=f"[{a}]")[1] for a in (30, 0))
    gains = [np.divide(values["maps/quality_fitted"], values["maps/quality"]) for values in (far, near)]
    assert np.divide(*gains) == pytest.approx(1.0, abs=0.05)
    # The pose enters by ellipsoids near the quartics; the division of the quartics' own surfaces is exact to 1e-4.
    [values] = cases(OVAL, angles="[30]", forces="[5]")
    contacts = list(soft_contacts(values, CURVED))
    for f, contact in enumerate(contacts):
        quartic = Quartic.of_coefficients(values["limit_surface/coefficients"][f][CURVED], 3)
        body = quartic.scaled(MU * np.array([1.0, 1.0, values["limit_surface/rho"][f]]))
        contacts[f] = SoftContact(contact.position, contact.axes, body)
    expected = pose_volume(*contacts, EXTENTS, 0.05, relative_error=1e-4, with_l1=False).linf
    assert values["maps/quality_fitted"][CURVED] == pytest.approx(expected, rel=2e-3)
    [facing] = cases(OVAL, "score.object_length_mm=longest", forces="[5]")
    [askew] = cases(OVAL, "score.object_length_mm=longest", "score.epsilon=everywhere", angles="[30]", forces="[5]")
    assert (np.array(facing["maps/epsilon"]) > 0).all()
    assert (np.array(askew["maps/epsilon"]) > 0).all()
    assert (np.array(askew["maps/epsilon"]) < facing["maps/epsilon"]).all()


@pytest.mark.parametrize(("shape", "rank"), [(PLATE, 3), (OVAL, 6)])
def test_a_plane_contact_resists_three_directions_and_a_curved_one_six(shape, rank):
    [(_, [result])] = solved(shape, "effects.wrench=6-D", "limit_surface.samples=60", forces="[5]")
    values = result.values
    assert values["limit_surface/rank_6d"] == [rank, rank]
    A = values["limit_surface/matrix_6d"][0]
    assert (np.linalg.eigvalsh(A) > 1e-9 * np.abs(A).max()).sum() == rank
    assert values["limit_surface/fit_error_6d"][0][1] < 0.05
    level, dropped, *_ = result.effects["wrench"]
    assert level == "6-D"
    assert (dropped > 1e-4) == (rank == 6)


def test_the_payload_is_friction_over_gravity_and_a_quartic_of_six_components_predicts_all_friction():
    """Two pads hold mu F each along the plate; beside the centre of mass the weight turns the plate as well."""
    few, down = "limit_surface.samples=100", "task.weight_direction=[0, 0, -1]"
    [above] = cases(PLATE, few, down, "object.mass_g=500", forces="[5]")
    expected = 2 * MU * 5 / WEIGHT
    assert above["maps/payload"] == pytest.approx([expected] * 3, rel=1e-3)
    assert above["maps/safety_factor"] == pytest.approx(np.divide(above["maps/payload"], 0.5), rel=1e-12)
    [beside] = cases(PLATE, few, down, "task.centre_of_mass_mm=[0, 30, 0]", forces="[5]")
    assert 0 < beside["maps/payload"][FLAT] < 0.9 * expected
    assert "maps/safety_factor" not in beside
    for drive, force in (("shared", 10), ("up_to", 5)):  # onto one finger
        pull = "task.weight_direction=[1, 0, 0]"
        [pulled] = cases(PLATE, few, pull, f"task.drive={drive}", forces="[5]")
        assert pulled["maps/payload"][CURVED] == pytest.approx(force / WEIGHT, rel=1e-3)
    [worst] = cases(PLATE, few, forces="[5]")
    assert 0.95 * expected / np.hypot(1, MU) < worst["maps/payload"][CURVED] <= expected / np.hypot(1, MU)
    assert not above["maps/flags"] & Flag.NOT_BORNE
    # Power of the friction for motions that it was not fitted to; a curved patch resists all six.
    patch = sj.read_pressure("jobs/cylinder-pressure.csv")
    fit = sj.fit_quartic(patch, mu=0.8, samples=1000, wrench="6-D")
    twist = sphere_motions(3000)[2000:] * np.repeat([1.0, 100.0], 3)
    power = np.einsum("md,md->m", sj.friction_wrench(patch, twist, 0.8), twist)
    off = np.abs(fit.surface.support(twist) / power - 1)
    assert off.max() < 0.2
    assert off.mean() < 0.02
    assert fit.fit_error.Erad < 0.01
    with pytest.raises(ValueError, match="wrench"):
        sj.fit_quartic(patch, mu=0.8, wrench="4-D")
