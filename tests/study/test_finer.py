"""Coarse first, fine where it matters: which cases the finer meshes get, and that no value is lost on the way."""

import numpy as np
import pytest
import trimesh

from softjaw.study.case.result import CaseResult
from softjaw.study.flags import Flag
from softjaw.study.quantities import DONE, FAILED, LISTED, MISSING
from softjaw.study.ranking import Place
from softjaw.study.result.skeleton import create
from softjaw.study.result.store import open_result, torn_rows
from softjaw.study.result.write import NOT_FINER, ResultWriter, record
from softjaw.study.run.load_path import settle
from softjaw.study.run.plan import make_plan
from softjaw.study.run.rounds import next_cases, rivals
from softjaw.study.show.status import unfinished, waits
from tests.study.formula_results import written
from tests.study.launching import contents, differing, launch
from tests.study.scenes import BALL, mesh_of, pose_of, scene_of, text_of

PAD = "[8, 4, 3]\nmax_opening_mm = 85"
SCENE = text_of(mesh_of("block.stl"), "sampled = 14\n", forces="[2, 5]", elements=PAD) + "[limit_surface]\nsamples = 80"


def sampled(*changes):
    """A scene with poses that count as sampled ones."""
    poses = "".join(pose_of((0, 0, z)) for z in range(4))
    made = scene_of(BALL, "accuracy.target=0.01", *changes, where=poses, forces="[2, 5]")
    return made.model_copy(update={"candidates": made.candidates.model_copy(update={"sampled": 4})})


def test_rivals_are_those_that_may_be_better_than_the_last_of_the_list_or_than_the_head_of_their_place():
    places = [Place(i, [], 0.0, []) for i in range(LISTED)] + [Place(10, [], 0.0, []), Place(11, [12], 0.0, [])]
    value = np.array([*np.linspace(2.0, 1.1, LISTED), 1.0, 0.9, 0.89])
    assert rivals(places, value, np.full(13, 0.04)) == []
    assert rivals(places, value, np.where(np.arange(13) == 11, 0.3, 0.04)) == [11]
    assert rivals([Place(0, [1], 0.0, [])], np.array([1.0, 0.99]), np.array([0.05, 0.02])) == [1]
    places, value = [Place(0, [], 0.0, []), Place(1, [], 0.0, [])], np.array([1.0, 0.5, 0.3, 0.4, 0.0])
    error = np.array([0.05, 0.02, 0.7, 0.3, np.inf])
    assert rivals(places, value, error, [2, 3, 4]) == [2, 4]
    assert rivals([], value, error, [2, 3, 4]) == [3, 2, 4]


def test_a_case_keeps_its_coarse_values_until_finer_ones_replace_them(tmp_path):
    made = sampled()
    first, path = make_plan(made), tmp_path / "a.hdf"
    create(path, first.layout, first.header)
    row = (0, 3, 1)
    later = make_plan(made, rounds=((row,),))
    number = 3 * 2 + 1
    assert later.header.digest == first.header.digest
    assert np.flatnonzero(later.wanted).tolist() == [number]

    def filled(layout, payload, mesh):
        return record(layout, CaseResult({"maps/payload": [payload] * 3, "maps/flags": 0.0, "work/mesh": mesh}))

    writer = ResultWriter(path, first.layout, None, first.wanted)
    for case in range(first.layout.rows):
        writer.write(case, filled(first.layout, 1.0, 0))
    assert (writer.codes() == DONE).all()
    writer.close()
    writer = ResultWriter(path, first.layout, None, later.wanted)
    assert np.flatnonzero(writer.codes() == MISSING).tolist() == [number]
    assert writer.attempts()[number] == 0
    writer.count_attempt(number)
    writer.tidy(number)  # as after a kill: the coarse values stand
    assert writer.attempts()[number] == 1
    assert torn_rows(path, first.layout) == []
    writer.fail(number, "it did not converge; run --retry-failed")
    assert (writer.codes() == DONE).all()
    assert writer.read("payload/ccm").ravel()[number] == 1.0
    message = writer.read("status/message").ravel()[number]
    assert b"it did not converge" in message
    with pytest.raises(ValueError, match="done already"):
        writer.write(number, filled(first.layout, 2.0, 1))
    settle(writer, later.units, [], retry_failed=False)
    assert (writer.codes() == DONE).all()
    codes = settle(writer, later.units, [], retry_failed=True)
    assert np.flatnonzero(codes == MISSING).tolist() == [number] == np.flatnonzero(writer.codes() == MISSING).tolist()
    assert writer.attempts()[number] == 0
    assert writer.read("payload/ccm").ravel()[number] == 1.0
    assert not writer.read("status/message").ravel()[number]
    writer.close()
    assert torn_rows(path, first.layout) == []


def test_a_case_that_rounds_name_three_times_counts_as_begun_once(tmp_path):
    made = sampled()
    first, path, row = make_plan(made), tmp_path / "a.hdf", (0, 3, 1)
    create(path, first.layout, first.header)
    for mesh in range(4):
        plan = make_plan(made, rounds=((row, (0, 2, 1)),) * mesh)
        writer = ResultWriter(path, first.layout, None, plan.wanted)
        # those that are finer than the scene's start from it: what has no state there is not tried again
        assert (writer.codes()[5], writer.attempts()[5]) == (MISSING if mesh < 2 else FAILED, 0)
        if mesh < 2:
            writer.count_attempt(5)
            writer.fail(5, "no state")
        assert writer.codes()[5] == FAILED
        assert writer.attempts()[7] == 0
        writer.count_attempt(7)
        writer.count_attempt(7)  # as after a kill on each mesh
        values = CaseResult({"maps/payload": [1.0] * 3, "maps/flags": 0.0, "work/mesh": mesh})
        writer.write(7, record(first.layout, values))
        assert writer.codes()[7] == DONE
        writer.close()


@pytest.mark.parametrize(("changes", "levels"), [
    ((), {1}), (("object.mass_g=100",), {0, 1}), (("object.mass_g=100", "load.normal_force_n=[5]"), {0}),
])  # fmt: skip
def test_with_a_mass_finer_meshes_go_to_the_force_below_too(tmp_path, changes, levels):
    made = sampled(*changes)
    plan = make_plan(made)
    *_, last = range(plan.layout.shape[-1])

    def case(index):
        if index == (3, 0, last):
            return "no state"
        held = 1.0 if index[-1] == last else 0.01  # kg
        values = {"maps/payload": [held] * 3, "maps/payload_error": 0.02, "maps/flags": 0.0, "work/mesh": 0}
        return CaseResult(values | ({"maps/safety_factor": [10 * held] * 3} if changes else {}))

    with open_result(written(tmp_path / "a.hdf", plan.layout, case, plan.header)) as result:
        named = next_cases(result, made)
    assert {level for *_, level in named} == levels
    assert (0, 3, last) in named  # the scene's mesh may have a state where the coarse one has none


@pytest.mark.parametrize(("rounds", "again"), [((), True), ((((0, 2, 1), (0, 2, 0)),), False)])
def test_a_grasp_that_gets_a_finer_mesh_gets_it_where_the_coarse_one_has_no_state(tmp_path, rounds, again):
    made = sampled()
    plan = make_plan(made, rounds=rounds)

    def case(index):
        if index in ((2, 0, 0), (3, 0, 0), (3, 0, 1)):
            return "no state"
        values = {"maps/payload": [0.01] * 3, "maps/payload_error": 0.02, "maps/flags": 0.0, "work/mesh": 0}
        return CaseResult(values)

    with open_result(written(tmp_path / "a.hdf", plan.layout, case, plan.header)) as result:
        named = next_cases(result, made)
    assert ((0, 2, 0) in named) == ((0, 3, 0) in named) == again
    assert {n for *_, n in named} == ({0, 1} if again else {1})


@pytest.mark.parametrize(("unknown", "named"), [(0.5, [2]), (1.1, [1, 2])])
def test_what_one_mesh_says_of_a_grasp_that_may_be_the_best_is_asked_of_the_next(tmp_path, unknown, named):
    made = sampled("load.normal_force_n=[5]")
    plan = make_plan(made, rounds=(tuple((0, n, 0) for n in range(4)),))  # all on the scene's mesh

    def case(index):
        held, flags = ((1.0, 0), (0.1, Flag.SLIPS), (1.5, Flag.COLLISION), (0.4, 0))[index[0]]
        error = unknown if flags == Flag.SLIPS else 0.004
        values = {"maps/payload": [held] * 3, "maps/payload_error": error, "maps/e_n_error": 0.02}
        return CaseResult(values | {"maps/flags": float(flags), "work/mesh": 1})

    with open_result(written(tmp_path / "a.hdf", plan.layout, case, plan.header)) as result:
        # one that slips is asked again where its error is larger than all it holds: edges may have met no node
        assert next_cases(result, made) == tuple((0, n, 0) for n in named)
        of_e_n = sampled("load.normal_force_n=[5]", 'accuracy.target_of="e_n"')
        assert next_cases(result, of_e_n) == tuple((0, n, 0) for n in sorted({*named, 0, 3}))


def test_a_case_gets_its_finer_meshes_with_every_sample_of_uncertain_inputs_at_its_point_of_a_sweep(tmp_path):
    uncertain = 'uncertainty={ samples = 8, spread = { "friction.mu" = 0.1 } }'
    made = sampled(uncertain, 'sweep={ "gripper.shear_modulus_kpa" = [40, 50] }')
    plan = make_plan(made, rounds=(((1, 2, 1),),))
    wanted = plan.wanted.reshape(plan.layout.shape)
    assert wanted.shape[:2] == (2, plan.layout.inputs) == (2, 9)
    assert wanted[1, :, 2, 0, 1].tolist() == [1] * 9
    assert wanted.sum() == 9
    for mesh in (0, 1):
        case = CaseResult({"maps/flags": 0.0, "work/mesh": mesh})
        file = written(tmp_path / f"{mesh}.hdf", plan.layout, lambda _, case=case: case, plan.header)
        with open_result(file) as result:
            assert waits(result) == 1 - mesh


@pytest.mark.long
@pytest.mark.ranks
def test_the_best_of_a_sampled_study_are_solved_well_with_the_same_bits_on_any_ranks(tmp_path):
    trimesh.creation.box(extents=(40, 60, 260)).subdivide_to_size(40).export(tmp_path / "block.stl")
    scene = tmp_path / "block.toml"
    scene.write_text(SCENE)
    runs = {ranks: scene.with_name(f"{ranks}.hdf") for ranks in (0, 2)}
    for ranks, path in runs.items():
        assert launch(ranks, "-m", "softjaw", "run", scene, "-o", path)[0] == 0
    expected = contents(runs[0])
    assert differing(runs[2], expected) == []
    with open_result(runs[0]) as result:
        mesh, payload = (result.read(name).reshape(-1, 2) for name in ("work/mesh", "payload/ccm"))
        error = result.read("payload/error").reshape(-1, 2)
        finer = result.layout.finer
        assert not unfinished(result)
    assert (mesh[:, 0] > 0).sum() == 1  # the force that is shown is the largest, and the best is known at both
    assert (mesh[:, 1] > 0).sum() == len(finer) - 1 >= LISTED
    assert np.isfinite(error).all()
    unsolved = mesh[:, 1] == 0
    best = np.sort((payload - payload * error)[~unsolved, 1])[-LISTED]
    assert ((payload * (1 + error))[unsolved, 1] <= best + 1e-9).all()


@pytest.mark.parametrize(
    ("message", "share", "levels"), [("", 0.02, {0, 1}), ("", 0.004, {1}), (f"{NOT_FINER}late", 0.02, {1})]
)
def test_a_force_beside_the_shown_one_is_named_again_only_if_a_further_mesh_is_to_tell_more(
    tmp_path, message, share, levels
):
    """What is named is solved on the next mesh with all samples of uncertain inputs, and so no more than without."""
    made = sampled("object.mass_g=100")
    plan = make_plan(made, rounds=(tuple((0, n, k) for n in range(4) for k in (0, 1)),))

    def case(index):
        held, error, text = (1.0, 0.02, "") if index[-1] else (0.01, share, message)
        values = {"maps/payload": [held] * 3, "maps/payload_error": error, "maps/flags": 0.0, "work/mesh": 1}
        return CaseResult(values | {"maps/safety_factor": [10 * held] * 3}, message=text)

    with open_result(written(tmp_path / "a.hdf", plan.layout, case, plan.header)) as result:
        assert {level for *_, level in next_cases(result, made)} == levels
