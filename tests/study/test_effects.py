"""What indicators measure, which reasons are given, and that no indicator lets `auto` skip an effect wrongly."""

from types import SimpleNamespace

import numpy as np
import pytest

from jobs import effects as job
from softjaw.fem.errors import ConvergenceError
from softjaw.study.case import effects, model
from softjaw.study.case.effects import FORCED, LITTLE, MUCH, UNDECIDED, EffectChoice, neglected_traction
from softjaw.study.case.effects import STIFF_PLATE as STIFF
from softjaw.study.case.solver import COARSE, Solved
from softjaw.study.flags import Flag
from softjaw.study.quantities import REASONS
from tests.study.launching import ROOT
from tests.study.scenes import CONE, NO_COUPLING, OVAL, scene_of
from tests.study.test_pipeline import PLATE, cases, e_n, solved
from tests.study.test_walls import CUP
from tests.study.test_walls import solved as on_wall

COUPLED = 'effects.friction_pressure_coupling="tangential"'
AUTO = 'effects.friction_pressure_coupling="auto"'
STEEL = ("gripper.sheet_thickness_mm=2",)
PLASTIC = ("gripper.sheet_thickness_mm=1", "gripper.sheet_modulus_gpa=2")
RIGID = 'effects.sheet="rigid"'
SLOPE = 'shape = "revolution"\nprofile_mm = [[0, 21], [20, 23.7], [40, 26.3], [60, 29]]'  # 7.6 degrees
FREE, TAKEN = "none", "tangential traction"
COUPLING = "friction_pressure_coupling"


def pressed(moved, pressure):
    """A pad's front moved as a whole by a vector [m], under an even pressure [Pa], on a plane."""
    pad = model.pad(scene_of(PLATE, elements="[4, 4, 2]").gripper, (False, False), "weighted", False, False)
    start = np.einsum("qa,fai->fqi", pad.face_N, pad.nodes[pad.face_nodes])
    normal = np.broadcast_to([0.0, 0.0, -1.0], start.shape)
    points = SimpleNamespace(position=start + moved, normal=normal, load=pressure * pad.face_area)
    return SimpleNamespace(pad=pad, points=points)


def test_neglected_traction_is_that_of_sheared_columns_until_they_slide():
    """E d / (thickness p) where that is below mu; moves along the normal do not count."""
    stiffness = pressed(np.zeros(3), 1.0).pad.modulus_per_thickness
    for d, p, mu in ((1e-4, 5e3, 0.8), (2e-3, 5e3, 0.8), (2e-3, 5e3, 0.3)):
        found = neglected_traction(pressed(np.array([0.6 * d, 0.8 * d, 3e-3]), p), mu)
        assert found == pytest.approx(min(mu, stiffness * d / p), rel=1e-12)
    assert neglected_traction(pressed(np.array([0.0, 0.0, 3e-3]), 5e3), 0.8) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("indicator", "changes", "target", "level", "reason"), [
    (0.019, None, 0.01, FREE, effects.BELOW),  # surely skipped: nothing is measured
    (0.02, (0.5, 0.0, 0.0), 0.01, TAKEN, effects.MUCH),
    (0.038, None, 0.02, FREE, effects.BELOW),  # the bound grows with the target
    (0.51, None, 0.01, TAKEN, effects.ABOVE),
    (0.1, (-0.007, 0.002, 0.0), 0.01, FREE, effects.LITTLE),
    (0.1, (-0.008, 0.0, 0.0), 0.01, TAKEN, effects.UNDECIDED),
    (0.1, (0.001, -0.011, 0.001), 0.01, TAKEN, effects.MUCH),  # the payload alone
    (0.1, (0.001, 0.001, 0.009), 0.01, TAKEN, effects.UNDECIDED),  # the quality alone
    (0.1, (0.001, np.nan, 0.001), 0.01, FREE, effects.LITTLE),  # a contact without torque has no payload
    (0.1, (np.nan, np.nan, np.nan), 0.01, TAKEN, effects.UNDECIDED),  # no state on the coarse mesh
    (np.nan, (0.001, 0.0, 0.0), 0.01, FREE, effects.LITTLE),
])  # fmt: skip
def test_an_effect_is_skipped_taken_or_measured(indicator, changes, target, level, reason):
    """Bounds of 0.02 and 0.5 for a target of 1 %."""
    asked = []
    step = effects.Step("none", "tangential", lambda c, k: indicator, 0.02, 0.5)
    found = effects.decided(COUPLING, step, indicator, lambda: asked.append(1) or changes, target)
    assert found[0] == level
    assert found.reason == reason
    assert bool(asked) == (changes is not None)
    np.testing.assert_equal(found[3:], changes if asked else (np.nan,) * 3)


class Prepared:
    """Solver of a candidate whose e_n and payload friction changes by shares at each force; ``lost`` have no state."""

    def __init__(self, changes, payloads=None, lost=()):
        self.scene, self.walled, self.lost = scene_of(PLATE, "accuracy.meshes=2", elements="[4, 4, 2]"), False, lost
        self.forces = tuple(range(1, len(changes) + 1))
        self.settings = SimpleNamespace(task=None)
        self.changes = changes, payloads or [0.0] * len(changes)

    def solve(self, k, mesh, levels):
        assert mesh == COARSE
        if k in self.lost and levels.friction_pressure_coupling == "tangential":
            raise ConvergenceError("the wall collapsed")
        shares = [1.0 + own[k] * (levels.friction_pressure_coupling == "tangential") for own in self.changes]
        ccm, few = SimpleNamespace(e_n=0.01 * shares[0]), np.isnan(shares[0])
        contact = SimpleNamespace(
            limits={"ccm": ccm}, payload=shares[1], on_few_elements=few, nodal_instead=False, state=None, mu=0.8
        )
        return SimpleNamespace(contacts=[contact, contact])

    def case(self, k, levels, left_out):
        return Solved([levels])


@pytest.fixture
def choice(monkeypatch):
    """Levels of the effects of a prepared candidate; its indicator leaves friction open."""
    monkeypatch.setattr(effects, "neglected_traction", lambda state, mu: 0.1)

    def values(contacts, settings):
        return {"maps/payload": [contacts[0].payload], "maps/quality": [1.0]}

    monkeypatch.setattr(effects, "grasp_values", values)
    return lambda *arguments, **more: EffectChoice(Prepared(*arguments, **more))


def levels_of(choice):
    return [choice.level(COUPLING, k) for k in range(choice.count)]


def test_the_level_at_a_force_depends_on_no_other_and_what_is_left_out_is_a_part_of_the_error(choice):
    """As measured at 175 mm of the bottle: e_n changes by 8 %, -0.4 % and -29 %, the payload in the middle by 5 %."""
    levels = levels_of(choice([0.077, -0.0042, -0.292], [0.1, 0.05, -0.3]))
    assert [level.reason for level in levels] == [effects.MUCH] * 3
    [alone] = levels_of(choice([-0.0042], [0.05]))
    assert alone == levels[1]
    levels = levels_of(choice([0.0042, 0.005, 0.006]))
    assert [level.reason for level in levels] == [effects.LITTLE] * 3
    assert [level.change for level in levels] == pytest.approx([0.0042, 0.005, 0.006], rel=1e-9)
    [level] = levels_of(choice([np.nan]))
    assert (level.reason, level.indicator) == (effects.UNDECIDED, 0.1)
    assert np.isnan(level.change)
    found = choice([0.0042, 0.2])
    found.solver.case = lambda k, levels, *_: Solved([levels, levels])  # on two meshes
    pairs = [found.case(k).pairs for k in range(2)]
    assert [len(pair) for pair in pairs] == [1, 0]
    found = choice([0.2, 0.2, 0.2], lost=[1])
    found.solver.walled, found.levels = True, found.levels._replace(object="nonlinear_shell")
    solved = [found.case(k) for k in range(3)]
    assert [own.fine.friction_pressure_coupling for own in solved] == ["tangential", "none", "tangential"]
    assert [bool(own.note) for own in solved] == [False, True, False]
    assert [level.level for level in levels_of(found)] == [TAKEN, FREE, TAKEN]
    assert [found.flags_at(k) for k in range(3)] == [Flag(0), Flag.LEFT_OUT, Flag(0)]

    def case(k, levels, left_out):
        if levels.friction_pressure_coupling == "tangential":
            raise ConvergenceError("no state")
        return Solved([levels], "own note")

    found = choice([0.2])
    found.solver.case = case
    assert found.case(0).note.endswith("; own note")
    assert found.level(COUPLING, 0).reason == effects.FAILED
    assert found.flags_at(0) == Flag.LEFT_OUT


def test_six_components_change_nothing_that_is_mapped():
    for one, six in zip(cases(OVAL), cases(OVAL, 'effects.wrench="6-D"'), strict=True):
        for name, value in one.items():
            if name.startswith("maps/"):
                np.testing.assert_allclose(value, six[name], rtol=1e-9)  # of the contact solve


def judged(rows, effect):
    """Whether each case took an effect, and the error where it does not; that no skip is wrong."""
    _, taken, error = job.of_effect(rows, effect)
    assert error[~taken].max(initial=0.0) <= job.WRONG
    return taken, error


@pytest.mark.long
def test_no_effect_of_rigid_objects_is_skipped_wrongly(monkeypatch):
    """Among the places one where a pad just reaches a waist's middle: there e_n changes most for least."""
    monkeypatch.chdir(ROOT)
    kept = ("bottle", "cylinder 8 x 8 mm", "plane")
    monkeypatch.setattr(job, "RIGID", {name: job.RIGID[name] for name in kept})
    monkeypatch.setitem(job.RIGID, "bottle", ("jobs/bottle-rigid.toml", "[60, 85]"))
    rows = list(job.patch_rows())
    assert max([row[5] for row in rows if row[0] == job.EXACT]) < 1e-6
    for effect, own in (("friction", rows), (job.COUPLING, list(job.PARTS["friction"][0]()))):
        taken, error = judged(own, effect)
        assert error[taken].max() > job.TARGET  # something to be wrong about
    assert not taken.all()


@pytest.mark.long
def test_no_shell_is_skipped_wrongly(monkeypatch):
    monkeypatch.chdir(ROOT)
    walls = {name: own for name, own in job.WALLS.items() if name.startswith("cup")}
    walls["cup 1 mm, 15 GPa"] = (job.CUP, "wall_mm=[[0, 1], [110, 1]]", 15, "[50]", "[2]")  # linear is enough there
    monkeypatch.setattr(job, "WALLS", walls)
    rows = list(job.wall_rows())
    for effect in (job.SHELL, job.SHELLS):
        taken, error = judged(rows, effect)
        assert error[taken].max() > job.TARGET
        assert not taken.all()


def sheet_level(*overrides):
    (found,) = {result.effects["sheet"][:3] for _, path in solved(OVAL, *overrides) for result in path}
    return found[0], found[1], REASONS[found[2]]


def test_a_steel_sheet_is_rigid_a_plastic_one_bends_and_what_is_neglected_stays_below_the_target():
    name, compliance, reason = sheet_level(*STEEL)
    assert (name, reason) == ("rigid", "indicator below the target")
    assert compliance < 0.2 * STIFF
    name, compliance, reason = sheet_level(*PLASTIC)
    assert (name, reason) == ("elastic plate", "indicator above the target")
    assert compliance > STIFF
    assert sheet_level(*PLASTIC, RIGID) == ("rigid", compliance, "forced by the scene")
    assert sheet_level(*STEEL, 'effects.sheet="elastic"')[::2] == ("elastic plate", "forced by the scene")
    # The rigid sheet_level of steel is good to far less than 2 % of e_n, that of the plastic sheet is not.
    np.testing.assert_allclose(e_n(OVAL, *STEEL), e_n(OVAL, *STEEL, RIGID), rtol=1e-9)  # of the contact solve
    off = {name: e_n(OVAL, *own, 'effects.sheet="elastic"') / e_n(OVAL, RIGID) - 1.0
           for name, own in (("steel", STEEL), ("plastic", PLASTIC))}  # fmt: skip
    assert np.abs(off["steel"]).max() < 1e-3
    assert (off["plastic"] < -0.02).all()  # the ends of the pad give way and carry less
    closing = [values["maps/closing"] for values in cases(OVAL, *PLASTIC)]
    assert (np.array(closing) > [values["maps/closing"] for values in cases(OVAL, RIGID)]).all()


@pytest.mark.long
def test_sheets_behind_the_pads_on_a_thin_wall():
    """Steel is as good as rigid, plastic is softer: the same force takes more closing displacement."""
    closing = {}
    for name, overrides in (("rigid", (RIGID,)), ("steel", STEEL), ("plastic", PLASTIC)):
        forced = () if name == "rigid" else ('effects.sheet="elastic"',)
        (result,) = on_wall(CUP, *overrides, *forced, forces="[1]")
        closing[name] = result.values["maps/closing"]
    assert closing["steel"] == pytest.approx(closing["rigid"], rel=1e-3)
    assert closing["plastic"] > 1.01 * closing["rigid"]
    (mounted,) = on_wall(CUP, "gripper.tilt_stiffness_nm_per_rad=10000", forces="[1]")
    assert mounted.values["maps/closing"] == pytest.approx(closing["rigid"], rel=1e-4)


def test_a_mount_that_tilts_spreads_the_contact_on_a_slope_and_a_stiff_one_changes_nothing():
    mounts = ([], *([f"gripper.tilt_stiffness_nm_per_rad={k}"] for k in (1e4, 0.2)))
    rigid, stiff, soft = (cases(CONE, *mount, stations="[75]", forces="[3]")[0] for mount in mounts)
    assert stiff["maps/e_n"] == pytest.approx(rigid["maps/e_n"], rel=2e-3)
    # turned to the slope the pad bears on more of its length
    assert soft["maps/contact_area"] > 1.05 * rigid["maps/contact_area"]
    assert soft["maps/e_n"][0] > 1.02 * rigid["maps/e_n"][0]


def coupling_levels(*overrides):
    found = [result.effects[COUPLING] for _, path in solved(OVAL, *overrides) for result in path]
    return [(own.level, own.reason) for own in found]


def test_levels_what_they_change_and_that_auto_takes_or_leaves_what_the_scene_could_ask_for():
    """A pad that cannot slide freely is stiffer; without friction nothing changes; e_n moves by a few per cent."""
    assert set(coupling_levels(NO_COUPLING)) == {("none", FORCED)}
    assert set(coupling_levels(COUPLED)) == {("tangential traction", FORCED)}
    off = e_n(OVAL, COUPLED) / e_n(OVAL, NO_COUPLING) - 1.0
    assert (np.abs(off) < 0.05).all()
    assert (np.abs(off) > 1e-3).all()
    for one, other in zip(cases(OVAL, COUPLED), cases(OVAL, NO_COUPLING), strict=True):
        assert one["maps/closing"] < other["maps/closing"]
        assert one["work/load_steps"][0] > other["work/load_steps"][0]
    smooth = ("friction.mu=0", COUPLED)
    closing = [[v["maps/closing"] for v in cases(OVAL, *own)] for own in (smooth, ("friction.mu=0", NO_COUPLING))]
    np.testing.assert_allclose(*closing, rtol=1e-9)
    # At every force by itself, to the solver's tolerance; which cases take it follows from the measured change.
    auto, taken, free = (e_n(OVAL, *own) for own in ((AUTO,), (COUPLED,), (NO_COUPLING,)))
    found = [result.effects[COUPLING] for _, path in solved(OVAL, AUTO) for result in path]
    with_it = np.array([own.level == "tangential traction" for own in found]).reshape(auto.shape)
    np.testing.assert_allclose(auto, np.where(with_it, taken, free), rtol=1e-9)
    for own, true in zip(found, (taken / free - 1.0).ravel(), strict=True):
        assert own.reason in (LITTLE, MUCH, UNDECIDED)
        assert own.change == pytest.approx(true, abs=0.01)


def test_what_pressing_has_used_is_missing_for_holding():
    """On a slope it is what slope and force ask for at most, for the plate bears a part; half and whole."""
    small = {"forces": "[3]", "elements": "[8, 4, 3]"}
    place = (COUPLED, "candidates.stations_mm=[30]")

    def of(*more):
        [values] = cases(SLOPE, *place, *more, **small)
        return values

    plain, left = of(), of("friction.used_by_pressing=true")
    whole = of("friction.used_by_pressing=true", 'effects.model_size="full"')
    used = plain["maps/f_x_max"] - left["maps/f_x_max"]
    assert 0.3 < used[0] / (np.tan(8 / 60) * plain["maps/F_N"]) < 1.0
    assert used[1:].tolist() == [0.0, 0.0]  # planar models know nothing of it
    assert left["maps/f_y_max"][0] == pytest.approx(plain["maps/f_y_max"][0], rel=1e-12)
    assert left["maps/f_x_max"][0] == pytest.approx(whole["maps/f_x_max"][0], rel=1e-6)
    assert left["maps/e_n"][0] == pytest.approx(whole["maps/e_n"][0], rel=1e-6)
    assert left["maps/quality"][0] < plain["maps/quality"][0]
