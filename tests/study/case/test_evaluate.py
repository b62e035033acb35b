"""All values of a case from two patches and settings, without a solver: closed forms of cylinders face to face."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softjaw.fem.objects.gap import Pose
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.payload import BOUND_GAP
from softjaw.scoring.pose import pose_volume
from softjaw.study.case import errors as weights
from softjaw.study.case.build import build_object, centre_of_volume, volume
from softjaw.study.case.candidates import with_sampled_grasps
from softjaw.study.case.contact import Contact, topology
from softjaw.study.case.errors import Unseen, coarse_errors, distance, estimate, mesh_errors
from softjaw.study.case.evaluate import FACING, EvaluationSettings, evaluate, lengths, quality
from softjaw.study.case.task import Task
from softjaw.study.flags import Flag
from softjaw.study.messages import StudyError
from softjaw.study.quantities import MODELS, TABLE, misses
from tests.friction.closed_forms import cylinder_torque
from tests.generators import cylinder_grid
from tests.study.scenes import BALL, BOX, OVAL, scene_of

MU, R, ANGLE, LENGTH, PRESSURE, DISTANCE = 0.5, 0.03, math.pi / 3, 0.04, 2e4, 0.06
S, F_N = 2 * R * ANGLE * LENGTH * PRESSURE, 2 * R * math.sin(ANGLE) * LENGTH * PRESSURE
SETTINGS = EvaluationSettings(arms=0.09, torques=0.05, task=Task(np.zeros(3)))
RING = np.array([[0, 0, 0, 0, 0], [0, 1, 1, 1, 0], [0, 1, 0, 1, 0], [0, 1, 1, 1, 0], [0, 0, 0, 0, 0]])


def pair(tilt=0.0, strips=65):
    """A patch, and the same half a turn about x away, tilted about x [rad]."""
    patch = cylinder_grid(R, ANGLE, LENGTH, strips, 64)
    one = Contact(replace(patch, pressure=PRESSURE * patch.pressure), MU)
    turn = np.diag([1.0, -1.0, -1.0]) @ Rotation.from_euler("x", tilt).as_matrix()
    return one, one.at(Pose(turn, np.add(one.origin, [0, 0, DISTANCE]) - turn @ one.frame.origin))


def test_forces_torque_e_n_and_the_quality_of_facing_ellipsoids_are_those_of_the_closed_form():
    contacts = pair()
    values, fits = evaluate(contacts, SETTINGS)
    torque = R**3 * PRESSURE * cylinder_torque(1.0, 1.0, ANGLE, LENGTH / R)
    assert values["maps/S"] == pytest.approx(S, rel=1e-12)
    assert values["maps/F_N"] == pytest.approx(F_N, rel=5e-5)
    assert values["maps/f_x_max"] == pytest.approx([MU * S, MU * S, MU * values["maps/F_N"]], rel=1e-12)
    assert values["maps/f_y_max"][0] == pytest.approx(MU * values["maps/F_N"], rel=1e-12)
    assert values["maps/e_n"][0] == pytest.approx(torque / S, rel=1e-4)
    assert values["maps/e_n_projected"][0] == pytest.approx(torque / F_N, rel=2e-4)
    assert values["maps/f_y_overestimate"] == pytest.approx(1 - F_N / S, rel=2.5e-4)  # F_N is good to 5e-5
    assert values["maps/contact_distance"] == pytest.approx(DISTANCE, rel=1e-12)
    assert fits[0] is fits[1]  # an image is fitted once
    assert not values["maps/flags"] & (Flag.NOT_ANTIPODAL | Flag.SLIPS | Flag.NO_FIT)
    # 14/9 pi^2 d^2 f_x^2 f_y^2 tau_z per newton of S, d over the arms' length and tau_z over the torques'.
    for m in range(len(MODELS)):
        f_x, f_y, tau = (values[f"maps/{name}_max"][m] / S for name in ("f_x", "f_y", "tau_z"))
        expected = 14 / 9 * math.pi**2 * (DISTANCE / 0.09) ** 2 * f_x**2 * f_y**2 * tau / 0.05
        assert values["maps/quality"][m] == pytest.approx(expected, rel=1e-9)
    assert quality(contacts, SETTINGS) == values["maps/quality"][0]
    assert quality(pair(1.01 * FACING), SETTINGS) == pytest.approx(values["maps/quality"][0], rel=1e-3)


def turned(contacts, angle):
    turn = Rotation.from_euler("y", angle).as_matrix()
    return tuple(c.at(Pose(turn @ c.pose.rotation, turn @ c.pose.origin)) for c in contacts)


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2])
def test_arms_are_scaled_along_the_axes_of_the_object(angle):
    """With one length for all axes the object may turn; with one for each, contacts stand where the scaled arms end."""
    contacts, sizes = turned(pair(), angle), np.array([0.05, 0.03, 0.09])
    assert quality(contacts, SETTINGS) == pytest.approx(quality(pair(), SETTINGS), rel=1e-9)
    found = quality(contacts, replace(SETTINGS, arms=sizes))
    along = contacts[0].normal
    if angle != 0.4:  # along an axis: in closed form, with its length
        assert found == pytest.approx(quality(pair(), replace(SETTINGS, arms=sizes @ np.abs(along))), rel=1e-9)
    else:
        bodies = [SoftContact(c.origin / sizes, c.axes, c.ellipsoids["ccm"]) for c in contacts]
        assert found == pytest.approx(pose_volume(*bodies, 1.0, 0.05).linf, rel=1e-4)
        closed = quality(pair(), SETTINGS) * (0.09 * np.linalg.norm(along / sizes)) ** 2
        assert found < 0.97 * closed


def test_extents_scale_arms_contacts_that_lean_are_flagged_and_errors_are_differences_of_meshes():
    for overrides, arms, torques in (
        ([], [0.05, 0.04, 0.12], 0.05),
        (['score.object_length_mm="longest"'], [0.12] * 3, 0.05),
        (["score.object_length_mm=80"], [0.08] * 3, 0.05),
        (['score.contact_length_mm="object"'], [0.05, 0.04, 0.12], 0.12),
    ):
        scene = scene_of(BOX, *overrides)
        found = lengths(scene, build_object(scene.object))
        assert found[0] == pytest.approx(arms, rel=1e-12)
        assert found[1] == pytest.approx(torques, rel=1e-12)
    fine, coarse = pair(math.radians(8.0)), pair(math.radians(8.0), strips=17)
    for contact, elements in ((fine[0], 8.0), (fine[1], 9.0), (coarse[0], 2.0), (coarse[1], 2.0)):
        contact.elements, contact.across, contact.lines = elements**2, elements, elements
        contact.on_edges, contact.overlap = 0.0, 0.0
    values, _ = evaluate(fine, SETTINGS)
    assert values["maps/flags"] & Flag.NOT_ANTIPODAL
    assert values["maps/misalignment"] == pytest.approx(math.radians(8.0), rel=1e-9)
    errors = mesh_errors(fine, coarse, values, {}, SETTINGS)
    other, _ = evaluate(coarse, SETTINGS)
    for name in ("e_n", "f_y_max", "quality"):
        part = 0.8 if name == "f_y_max" else 0.7  # of contacts that the mesh resolves
        expected = part * weights.OF_FARTHEST * abs(other[f"maps/{name}"][0] / values[f"maps/{name}"][0] - 1)
        assert errors[f"maps/{name}_error"] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    alone = mesh_errors(fine, fine, values, {}, SETTINGS)
    gap = BOUND_GAP * (1 + 1.6 * BOUND_GAP)
    assert {name: error for name, error in alone.items() if error} == {"maps/payload_error": gap}
    floor = mesh_errors(fine, fine, values, {}, SETTINGS, unseen=Unseen(0.01, 0.02, 0.5))
    found = [floor[f"maps/{name}_error"] for name in ("e_n", "f_x_max", "p_max")]
    edges = [0.5 * weights.OF_EDGES[name] for name in ("e_n", "f_x_max", "p_max")]
    shares = [0.007, 0.008 * weights.WIDER["f_x_max"], 0.02 * weights.OF_WIDTH["p_max"]]
    lost = max(1.0 - contact.limits["ccm"].F_N / contact.limits["ccm"].S for contact in fine)
    edges[1] += 0.5 * weights.OF_CORNERS["f_x_max"] * weights.OF_LOSS * lost
    assert found == pytest.approx(np.add(shares, edges))
    # of a coarse mesh alone all is in doubt, that of f_x no less: friction that is left out would move it
    alone = coarse_errors(fine, values, [fine, coarse], SETTINGS, rounded=False)
    assert alone["maps/f_x_max_error"] == pytest.approx(weights.DOUBTED * Unseen.of(fine).floor, rel=1e-6)
    # the more elements bear, the less they agree by luck
    few, many = Unseen.of(coarse), Unseen.of(fine, coarse=True)
    assert np.divide(many[:2], few[:2]) == pytest.approx([2 / 16**weights.POWER, 2 / 4**weights.POWER], rel=1e-9)
    task = replace(SETTINGS, task=Task((fine[0].origin + fine[1].origin) / 2))
    held, less = (evaluate(contacts, task)[0]["maps/payload"][0] for contacts in (fine, coarse))
    error = mesh_errors(fine, coarse, {**values, "maps/payload": [held]}, {}, task)["maps/payload_error"]
    apart = abs(less / held - 1)
    expected = 0.8 * weights.OF_FARTHEST * apart * (1 + apart) + BOUND_GAP
    assert error == pytest.approx(expected * (1 + 1.6 * expected), rel=1e-9)
    held = {**values, "maps/payload": [held]}
    sharp, edged = (coarse_errors(fine, held, [fine, coarse], task, r)["maps/payload_error"] for r in (False, True))
    assert edged == pytest.approx(weights.EDGES_ROUNDED * sharp, rel=1e-12)
    # a coarse mesh on which friction does not bear the squeeze leaves all of the payload in doubt
    slips = pair(math.radians(60.0), strips=17)
    errors = mesh_errors(fine, slips, held, {}, task)
    assert errors["maps/payload_error"] == 1.0


def test_every_quantity_with_an_error_gets_one():
    """Of a finger each, the largest counts; what has no value to be a share of has no error."""
    fine, coarse = pair(), pair(strips=17)
    task = replace(SETTINGS, task=Task((fine[0].origin + fine[1].origin) / 2, mass=0.1))
    values, other = evaluate(fine, task)[0], {"maps/closing": 1.1e-3, "maps/opening_loaded": 0.049}
    values |= {"maps/closing": 1e-3, "maps/opening_loaded": 0.050}
    pad = SimpleNamespace(shape=SimpleNamespace(element="hex8"), material=SimpleNamespace(poisson_ratio=0.25))
    fine[0].state = fine[1].state = SimpleNamespace(pad=pad, closing=1e-3, points=SimpleNamespace(friction=None))
    # of a wall all of the distance is left
    dents = [mine | {"maps/indentation": dent} for mine, dent in ((values, 1e-3), (other, 1.1e-3))]
    assert mesh_errors(fine, coarse, *dents, task)["maps/indentation_error"] == pytest.approx(0.1, rel=1e-9)
    # and what friction or load steps do to it, which contacts do not tell
    walls = [SimpleNamespace(wall_values=lambda _, dent=dent: {"maps/indentation": dent}) for dent in (2e-3, 2.4e-3)]
    steps = [(*(SimpleNamespace(contacts=fine, fingers=wall) for wall in walls), 0.5)]
    error = mesh_errors(fine, coarse, *dents, task, pairs=steps)["maps/indentation_error"]
    assert error == pytest.approx(0.1 + 0.5 * 0.4, rel=1e-9)
    errors = mesh_errors(fine, coarse, values, other, task)
    assert set(errors) == {q.of_error.key for q in TABLE if q.error and "wall" not in q.needs}
    assert np.isfinite([*errors.values()]).all()
    assert errors["maps/closing_error"] == pytest.approx(0.7 * weights.OF_FARTHEST * 0.1, rel=1e-9)
    assert errors["maps/opening_loaded_error"] == pytest.approx(0.7 * weights.OF_FARTHEST * 0.1 * 2e-3, rel=1e-9)
    # trilinear elements lock: of foam that is hardly compressed they close less than finer ones
    floors = []
    for pad.shape.element, pad.material.poisson_ratio in (("hex8", 0.25), ("hex8", 0.45), ("hex27", 0.45)):
        unseen = Unseen(0.0, 0.01, 0.0)
        floors.append(mesh_errors(fine, coarse, values, other, task, unseen=unseen)["maps/closing_error"])
    expected = 0.7 * 0.01 * weights.OF_WIDTH["closing"] * np.array([0.8, 2.4, 1.0])
    assert np.array(floors) - errors["maps/closing_error"] == pytest.approx(expected, rel=1e-9)
    peaks = [contacts[0].patch.pressure.max() for contacts in (fine, coarse)]
    assert errors["maps/p_max_error"] == pytest.approx(weights.OF_FARTHEST * abs(peaks[1] / peaks[0] - 1), rel=1e-9)
    assert errors["maps/safety_factor_error"] == pytest.approx(errors["maps/payload_error"], rel=1e-9)
    assert distance([1.0, 2.0], [1.1, 2.1], "relative") == pytest.approx(0.1, rel=1e-9)
    assert np.isnan(distance([0.0], [1.0], "relative"))
    assert distance([0.0], [1.0], "relative", [4.0]) == pytest.approx(0.25)
    assert distance([0.0], [-1.0], "absolute") == pytest.approx(1.0)
    # views of the coarser contact count, too: both meshes may agree by chance
    found = [estimate([1.0], [c], [[1.3], [0.8]], "relative") / weights.OF_FARTHEST for c in (1.0, 1.4)]
    assert found == pytest.approx([0.3, 0.4], rel=1e-9)
    found = [misses(e, t) for e, t in ((0.01, None), (0.02, None), (0.02, 0.02), (0.021, 0.02), (np.nan, 0.02))]
    assert found == [False, True, False, True, False]


@pytest.mark.parametrize(("share", "borne"), [(0.9, True), (1.1, False)])
def test_a_couple_of_the_squeeze_comes_before_any_load(share, borne):
    """Two forces F_N that pass each other by h make a couple F_N h along y; friction mu S along x, apart, takes it."""
    one, two = pair()
    passing = [share * MU * S / F_N * DISTANCE, 0.0, 0.0]
    two = two.at(Pose(two.pose.rotation, two.pose.origin + passing))
    assert one.pressure_wrench[2] == pytest.approx(F_N, rel=5e-5)
    assert two.pressure_wrench[:3] == pytest.approx(-one.pressure_wrench[:3], abs=1e-9)
    middle = (one.origin + two.origin) / 2
    values, _ = evaluate((one, two), replace(SETTINGS, task=Task(middle)))
    assert (values["maps/payload"][0] > 0) == borne
    assert bool(values["maps/flags"] & Flag.NOT_BORNE) != borne


def test_the_centre_of_mass_is_that_of_the_volume_in_its_own_frame():
    """Of a tetrahedron the mean of its corners; that of its surface or of the box round it lies elsewhere."""
    corners = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 5]]) * 0.01 + [0.1, 0.2, 0.3]
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    body = SimpleNamespace(surface=lambda: (corners, faces))
    assert centre_of_volume(body) == pytest.approx(corners.mean(axis=0), rel=1e-12)
    assert centre_of_volume(build_object(scene_of(BALL).object)) == pytest.approx([0, 0, 0], abs=1e-15)


def test_a_mass_is_density_times_volume_and_what_has_no_volume_or_several_is_refused():
    ball = with_sampled_grasps(scene_of(BALL, "object.density=1000"))
    assert ball.object.mass == pytest.approx(1000 * 4 / 3 * math.pi * 0.03**3, rel=1e-4)
    assert ball.object.density is None
    bead = with_sampled_grasps(scene_of(BALL, "object.density=200", "object.radius_mm=1.5"))
    assert bead.object.mass == pytest.approx(200 * 4 / 3 * math.pi * 0.0015**3, rel=1e-3)
    tube = with_sampled_grasps(scene_of(OVAL, "object.density=500"))
    assert tube.object.mass == pytest.approx(500 * math.pi * 0.025 * 0.02 * 0.12, rel=5e-3)
    uncertain = 'uncertainty.spread={"object.radius_mm"=1}'
    for shape, *change in (['shape = "plane"\nthickness_mm = 30'], [BALL, "sweep.object.radius_mm=[20, 30]"],
                           [BALL, uncertain]):  # fmt: skip
        with pytest.raises(StudyError, match="mass_g"):
            with_sampled_grasps(scene_of(shape, "object.density=1000", *change))


def test_the_volume_is_that_of_the_body_that_is_solved_with_its_caps_and_rounded_rims():
    """By Pappus each rim lacks (1 - pi / 4) r^2, 0.2234 r inside the wall. A revolution: pi r^2 dz on its curve."""
    pill = 'shape = "elliptic_cylinder"\nsemi_axis_a_mm = 5\nsemi_axis_b_mm = 5\nlength_mm = 8'
    rims = 4 * math.pi * (5 - 2 * (10 - 3 * math.pi) / (12 - 3 * math.pi)) * (1 - math.pi / 4) * 2**2
    assert volume(scene_of(pill, stations="[0]").object) == pytest.approx((math.pi * 25 * 8 - rims) * 1e-9, rel=5e-3)
    for profile in ([[0, 30], [40, 26], [50, 25], [100, 20]], [[0, 10], [30, 30], [60, 20], [80, 12], [120, 12]]):
        shape = scene_of(f'shape = "revolution"\nprofile_mm = {profile}', stations="[50]").object
        curve = build_object(shape).curve
        z, r = curve.derivative(np.linspace(0, curve.breaks[-1], 20001)).T
        assert volume(shape) == pytest.approx(math.pi * np.diff(z) @ (r[1:] ** 2 + r[:-1] ** 2) / 2, rel=5e-3)


@pytest.mark.parametrize(("loaded", "pieces", "holes", "rims"), [
    (np.zeros((5, 5)), 0, 0, 0),
    (np.ones((5, 5)), 1, 0, 15),
    (RING, 1, 1, 0),
    (np.eye(5), 1, 0, 15),  # faces that meet at a corner are one piece
    (np.diag([1, 1, 0, 1, 1]), 2, 0, 15),
    (np.diag([0, 1, 1, 1, 0]), 1, 0, 0),
    (np.pad(RING, [(0, 0), (0, 5)]) + np.pad(RING, [(0, 0), (5, 0)]), 2, 2, 0),
    (np.outer([1, 0, 0, 1], [0, 1, 1, 0]), 2, 0, 3),
    (np.outer([0, 1, 1, 0], [1, 0, 0, 0]), 1, 0, 4),
])  # fmt: skip
def test_pieces_holes_and_rims(loaded, pieces, holes, rims):
    assert topology(3e4 * loaded.ravel(), loaded.shape) == {"pieces": pieces, "holes": holes, "rims": rims}
