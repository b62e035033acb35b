"""The best grasps: which force, which order, which errors; the same numbers in text, CSV and JSON."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from softjaw.study.export.selection import chosen
from softjaw.study.flags import Flag
from softjaw.study.lookup import GraspMap
from softjaw.study.quantities import DONE, FAILED, MODELS, quantities
from softjaw.study.ranking import distinct, judge, judged, keys_at
from softjaw.study.result import read
from softjaw.study.result.skeleton import ROUND_COMPLETE
from softjaw.study.result.store import open_result
from softjaw.study.run.objects import row_of
from softjaw.study.run.refine import scores_of_poses
from softjaw.study.scene import parse_scene
from softjaw.study.show.best_grasps import best, safe_range
from softjaw.study.show.places import short_name
from softjaw.study.show.status import grouped, sessions
from softjaw.study.table import MOST_NOTES, PAPER, as_csv, as_json
from tests.study import formula_results
from tests.study.scenes import BALL, pose_of, text_of

FORCES = np.array([1.0, 5.0])
WIDE = ("mass", "wall", "two meshes")
WALL = '[object]\nshape = "box"\nsize_mm = [140, 40, 140]\nedge_radius_mm = 2\n[gripper]\npreset = "franka_hand"\n'
WALL += "[load]\nnormal_force_n = [1, 5]\n" + "".join(pose_of((x, 0, 0), (0, 1, 0), (1, 0, 0)) for x in (0, 60))


def study(quality, flags=0.0, labels=None, status=DONE, needs=()):
    quality = np.asarray(quality, dtype=float)
    shape = (*quality.shape, len(FORCES))
    over = ("station", "angle", "normal_force")
    every = np.broadcast_to(quality[..., None], shape)
    maps = {
        q.name: ((*over, *q.dims), np.broadcast_to(every[..., None], (*shape, 3)) if q.by_model else every,
                 {"units": q.unit})
        for q in quantities(needs) if q.group == "maps"
    }  # fmt: skip
    maps["flags"] = (over, np.broadcast_to(np.reshape(flags, (-1, 1, 1)), shape).astype(np.int64))
    maps["status"] = (over, np.full(shape, status))
    given = np.array(labels).reshape(-1, 1) if labels else np.full(quality.shape, "")
    axes = {"station": (np.arange(shape[0], dtype=float), "" if labels else "m"),
            "angle": (np.arange(shape[1]) * np.pi / 2, "rad"), "normal_force": (FORCES, "N")}  # fmt: skip
    coordinates = {name: (name, v, {"units": u, "long_name": name}) for name, (v, u) in axes.items()}
    coordinates |= {"label": (over[:2], given), "model": list(MODELS)}
    return xr.Dataset(maps, coordinates, {"poses": bool(labels), "derived": (), "scene": ""})


def cells(table, name):
    column = next(c for c in table.columns if c.name == name)
    return [table.cell(row, column) for row in table.rows]


@pytest.mark.parametrize("top", [1, 2, 3, 0])
def test_images_of_a_grasp_share_a_line_and_count_as_one(top):
    pairs = study([[4, 4], [3, 3], [2, 1]])
    table = best(pairs, top=top, lines=True)
    assert len(table.rows) == (top or 4)
    assert cells(table, "name") == ["s00", "s02", "s04", "s05"][: top or 4]
    assert "90" in cells(table, "others")[0]
    assert len(as_csv(best(pairs, top=top)).splitlines()) == 1 + (top or 6)
    sides = pairs.assign(opening=pairs.opening * (1 + pairs.angle))  # a box holds as well on its other sides
    assert len(best(sides, top=top, lines=True).rows) == (top or 6)


def test_flags_are_counted_words_or_bits_and_messages_that_differ_in_numbers_are_one_kind():
    both = float(Flag.HOLE | Flag.COARSE)
    table = best(study([[3.0], [2.0], [1.0]], flags=[0.0, float(Flag.HOLE), both]))
    assert cells(table, "notes") == ["", Flag.HOLE.word, f"{Flag.HOLE.word}, {Flag.COARSE.word}"]
    assert [row["flags"] for row in table.rows] == [0, Flag.HOLE, Flag.HOLE | Flag.COARSE]
    for flag, count in ((Flag.HOLE, 2), (Flag.COARSE, 1)):
        assert sum(f"{flag.word} ({count} of 3)" in note for note in table.notes) == 1
    assert any(Flag.HOLE.sentence in note for note in table.notes)
    assert len(table.notes) <= MOST_NOTES
    assert all(len(note) <= PAPER for note in table.notes if "; " in note)
    status = np.array([FAILED, DONE, FAILED, DONE])
    messages = np.array(["residual 1e-3", f"{Flag.HOLE.sentence}; slow", "residual 2.5", Flag.HOLE.sentence])
    kinds = grouped(status, messages, np.full(4, int(Flag.HOLE)))
    assert [(kind.state, len(kind.cases), kind.message) for kind in kinds] == [
        (FAILED, 2, "residual 1e-3"), (DONE, 2, Flag.HOLE.sentence), (DONE, 1, "slow"),
    ]  # fmt: skip
    assert kinds[0].cases == [(0,), (2,)]


def rising(masses=None, safety=2, flags=0, **more):
    """Two stations: payload 0.1 and 0.2 kg per newton at 1 and 5 N, quality the other way round."""
    ds = study([[2.0], [1.0]], flags, needs=["mass"] if masses else (), **more)
    held = np.array([0.1, 0.2])[:, None, None] * FORCES
    ds["payload"] = (ds.payload.dims, np.repeat(held[..., None], 3, axis=-1), {"units": "kg"})
    if masses:
        ds["safety_factor"] = ds.payload / masses
        over = ds.status.dims[:-1]
        force = safety * masses / np.array([[0.1], [0.2]])
        ds = ds.assign(force_low=(over, np.where(force <= 5, force, np.nan)), force_low_error=(over, 0.01 * force))
        scene = f"[object]\nmass_g = {1e3 * masses}\n[task]\nsafety = {safety}\nweight_direction = 'worst'"
        ds = ds.assign_attrs(scene=scene, has=("mass", "task"))
    return ds


def stations(table):
    return [row["station"] for row in table.rows]


def test_a_force_between_two_solved_ones_needs_both_and_carries_their_flags():
    columns = best(rising()).columns
    for force, held in ((1.0, 0.2), (2.5, 0.5), (5.0, 1.0)):
        table = best(rising(), force=force, by="payload")
        assert table.facts["force"] == force
        assert table.columns == columns
        assert table.rows[0]["payload"] == pytest.approx(held, rel=1e-12)
    for force in (0.9, 5.1):
        with pytest.raises(ValueError, match=f"{force:g} N"):
            best(rising(), force=force)
    ds = rising()
    ds.status.values[0, 0, 1] = FAILED
    ds.flags.values[1, 0, 0], ds.flags.values[1, 0, 1] = Flag.HOLE, Flag.COARSE
    table = best(ds, force=2.0)
    assert stations(table) == [1.0]
    assert table.rows[0]["flags"] == Flag.HOLE | Flag.COARSE
    ds.flags.values[1, 0, 1] = Flag.SNAPPED
    assert not best(ds, force=2.0).rows
    ds.status.values[0, 0, 1] = DONE
    assert f"left out: {short_name(ds, 1)}, as" in " ".join(best(ds, force=2.0).notes)


def test_a_centre_of_mass_that_is_hardly_known_is_said_first():
    ds = rising()
    for error, count in ((0.0005, 0), (0.05, 1)):
        notes = best(ds.assign_attrs(object_centroid_error=np.array([error]))).notes
        assert sum("50 mm" in note for note in notes) == count


def test_a_window_between_two_solved_forces_is_shown_where_it_lies():
    """150 g twice over need 3 and 1.5 N; the wall bears 2 N of 1 and 5."""
    ds = rising(0.15)
    ds = ds.assign(force_high=ds.force_low.copy(data=np.full(ds.force_low.shape, 2.0)))
    table = best(ds)
    assert table.facts["force"] == pytest.approx(1.5)
    assert stations(table)[0] == 1.0
    assert table.rows[0]["payload"] == pytest.approx(0.3)
    assert safe_range(judge(ds), (1, 0, 0)) == "1.5..2"  # 5 N is the largest solved force there, too
    hard = ds.assign(force_high=ds.force_low.copy(data=[[0.1], [2.0]]), flags=ds.flags | Flag.YIELDS)
    assert stations(best(hard, by="quality", force=5.0)) == [1.0, 0.0]  # a smaller force suits the first one
    ds["finger_rims"] = ((*ds.status.dims, "finger"), np.zeros((*ds.status.shape, 2)), {"units": ""})
    ds["finger_pieces"] = ds["finger_holes"] = ds.finger_rims.copy(data=np.add(ds.finger_rims.values, [[1], [2]]))
    table = best(ds)  # contacts change on the way: the nearest that is solved, and what to do
    assert table.facts["force"] == 1.0
    assert stations(best(ds, by="quality")) == [1.0, 0.0]  # both are too weak at 1 N, and the other one is safe nowhere
    assert not best(ds, force=2.0).rows
    assert "none" not in best(ds, force=2.0).title


def test_grasps_are_ranked_by_payload_or_what_is_named_and_of_those_alike_the_simpler_comes_first():
    assert stations(best(rising())) == [1.0, 0.0]
    assert stations(best(rising(), by="quality")) == [0.0, 1.0]
    assert stations(best(rising(0.3))) == [1.0, 0.0]
    assert stations(best(rising(0.3), by="quality", force=5.0)) == [1.0, 0.0]  # the other is too weak there
    assert stations(best(rising(0.1), by="quality")) == [1.0, 0.0]
    assert stations(best(rising(0.1), by="quality", force=5.0)) == [0.0, 1.0]
    # At 5 N the second holds more, but the first needs less force to hold 150 g twice over.
    ds = rising(0.15)
    ds.payload.values[0, 0], ds.payload.values[1, 0] = [[0.12], [0.45]], [[0.11], [0.9]]
    ds["force_low"].values[:] = [[3.2], [3.5]]
    ds["safety_factor"] = ds.payload / 0.15
    assert stations(best(ds)) == [1.0, 0.0]
    assert stations(best(ds, by="force")) == [0.0, 1.0]
    ds["force_low"].values[0] = np.nan
    assert stations(best(ds, by="force")) == [1.0, 0.0]
    with pytest.raises(ValueError, match="mass_g"):
        best(rising(), by="force")
    # Payloads 1.00, 0.99, 0.985 with 2 % each cannot be told apart, 0.9 can.
    ds = study([[1.0], [0.99], [0.985], [0.9]], flags=[float(Flag.NOT_ANTIPODAL), float(Flag.COARSE), 0.0, 0.0])
    assert stations(best(ds)) == [0.0, 1.0, 2.0, 3.0]
    ds["payload_error"] = (ds.status.dims, np.full(ds.status.shape, 0.02), {"units": ""})
    assert stations(best(ds)) == [2.0, 1.0, 0.0, 3.0]
    ds["flags"].values[:] = 0
    assert stations(best(ds)) == [0.0, 1.0, 2.0, 3.0]
    ds["payload_error"].values[0] = 0.04
    assert stations(best(ds)) == [1.0, 2.0, 0.0, 3.0]  # 0.97, 0.965 and 0.96 are sure
    ds = study([[1.0], [0.5]], flags=[float(Flag.NOT_ANTIPODAL), 0.0])
    ds["payload_error"] = (ds.status.dims, np.repeat([0.02, 1.2], 2).reshape(ds.status.shape), {"units": ""})
    assert stations(best(ds)) == [0.0, 1.0]
    # 1.0 to within 1.0 is alike to all; of these 0.96 surely holds more than 0.47, which has no flag
    ds = study([[1.0], [0.96], [0.8], [0.47]], flags=[float(Flag.COARSE)] * 2 + [0.0] * 2)
    errors = np.repeat([1.0, 0.1, 0.45, 0.03], 2).reshape(ds.status.shape)
    ds["payload_error"] = (ds.status.dims, errors, {"units": ""})
    table = best(ds)
    assert stations(table) == [1.0, 2.0, 0.0, 3.0]
    assert "place 1 is best beyond errors, but too little is known of 2, 3" in " ".join(table.notes)
    ds["payload_error"].values[:] = 0.9
    assert "too little is known of 2, 3, 4 to compare them with place 1" in " ".join(best(ds).notes)
    ds = study([[0.96], [0.9], [0.85]])
    errors = np.repeat([0.02, 0.01, 0.14], 2).reshape(ds.status.shape)
    ds["payload_error"] = (ds.status.dims, errors, {"units": ""})
    assert re.findall(r"places (.*) are equal", " ".join(best(ds).notes)) == ["1 and 3"]


def test_a_grasp_without_an_error_neither_leads_its_equals_nor_parts_them():
    ds = study([[1.0], [0.99], [0.98], [0.5]])
    errors = np.repeat([0.3, np.nan, 0.01, 0.01], 2).reshape(ds.status.shape)
    ds["payload_error"] = (ds.status.dims, errors, {"units": ""})
    assert stations(best(ds)) == [2.0, 1.0, 0.0, 3.0]
    errors[0] = 0.025
    table = best(ds)
    assert stations(table) == [0.0, 2.0, 1.0, 3.0]
    assert "places 1 and 2 are equal within errors, but too little is known of 3" in " ".join(table.notes)


def test_places_are_compared_where_none_holds_the_mass_and_what_is_said_of_errors_and_of_common_flags_is_whole():
    ds = rising(5.0)  # kg
    ds.payload.values[:] = 0.9
    errors = np.repeat([0.02, 0.03], 2).reshape(ds.status.shape)
    ds["payload_error"] = (ds.status.dims, errors, {"units": ""})
    assert "places 1 and 2 are equal within errors" in " ".join(best(ds).notes)
    ds = study([[1.0], [0.8], [0.3], [0.2]], flags=[0.0, *[float(Flag.COARSE)] * 3])
    ds = ds.assign_attrs(scene='\n[accuracy]\ntarget = 0.01\ntarget_of = "payload"\n')
    errors = np.repeat([0.02, 0.03, 0.04, 0.06], 2).reshape(ds.status.shape)
    ds["payload_error"] = (ds.status.dims, errors, {"units": ""})
    [line] = [note for note in best(ds).notes if note.startswith("accuracy: place 1 is best beyond errors")]
    assert "payload errors up to 6 %, 4 of 4 above 1 %; the largest at" in line
    assert "coarse (3 of 4)" in line  # the rows do not repeat it


def test_the_force_is_the_largest_that_most_share_or_the_lowest_that_holds_a_mass_and_payload_in_grams():
    assert best(rising()).facts["force"] == 5.0
    some = rising()
    some.status.values[0, 0, 1] = FAILED
    assert best(some).facts["force"] == 1.0
    assert best(rising(0.3)).facts["force"] == 5.0
    assert best(rising(0.1)).facts["force"] == 1.0
    assert best(rising(3.0)).facts["force"] == 5.0  # none holds it
    table = best(study([[0.2], [0.1]]))
    assert cells(table, "payload") == ["200", "100"]
    assert [row["payload"] for row in table.rows] == [0.2, 0.1]
    assert "payload [kg]" in as_csv(table).splitlines()[0].split(",")


def test_errors_stand_with_what_they_belong_to_and_the_largest_is_found_with_its_place():
    table = best(study([[0.04]], needs=WIDE))
    for name in ("quality", "e_n", "f_x_max", "f_y_max", "tau_z_max"):
        column = next(c for c in table.columns if c.name == name)
        assert column.error == f"{name}_error"
        assert table.rows[0][column.error] == 0.04
    assert cells(table, "e_n") == ["40.0 ± 1.6"]  # mm, 4 %
    assert cells(table, "opening_loaded") == ["40 ± 40"]  # its error is absolute
    assert table.facts["largest_error"]
    assert not any(c.error for c in best(study([[4.0]])).columns)
    known = study([[0.5, 0.5], [0.5, 0.5]], needs=WIDE)
    # The 50 % at another force do not count.
    errors = np.array([[[0.5, 0.002], [np.nan, np.nan]], [[0.01, 0.018], [0.5, 0.001]]])
    over, states = known.status.dims, np.full((2, 2, 2), DONE)
    states[1, 1, 0] = FAILED
    known["payload_error"], known["status"] = (over, errors, {"units": ""}), (over, states)
    told = best(known).facts["largest_error"]
    for words in ("1.8 %", "station 1000 mm, angle 0 deg, 5 N", "1 of 4"):
        assert words in told
    assert "1 of 3" not in told  # the scene names no target
    aimed = known.assign_attrs(scene=known.scene + '\n[accuracy]\ntarget = 0.01\ntarget_of = "payload"\n')
    assert "1 of 3" in best(aimed).facts["largest_error"]
    assert best(known, force=5.0).facts["largest_error"] == told
    known["payload_error"] = (over, np.full((2, 2, 2), np.nan), {"units": ""})
    assert "none of 4" in best(known).facts["largest_error"]


def test_grasps_less_than_half_a_pad_apart_share_a_line_unless_they_are_rolled():
    """Pads of 50 by 22 mm at z = 0, 20 and 60 mm; the last of three at 0 mm is rolled by 45 degrees."""
    ds = study([[5.0], [4.0], [3.0], [2.0]], labels=["a", "b", "c", "d"])
    turn = np.broadcast_to(np.stack([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]], axis=1), (*ds.status.shape, 2, 3, 3)).copy()
    turn[3] = turn[3] @ Rotation.from_euler("z", 45, degrees=True).as_matrix()
    origin = np.zeros((*ds.status.shape, 2, 3))
    origin[..., 0, 0], origin[..., 1, 0] = 0.03, -0.03
    origin[..., 2] = np.array([0.0, 0.02, 0.06, 0.0])[:, None, None, None]
    origin[1] = origin[1, :, :, ::-1]  # its fingers have changed sides
    over = ds.status.dims
    ds = ds.assign(finger_pose_origin=((*over, "finger", "component"), origin),
                   finger_pose_rotation=((*over, "finger", "component", "axis"), turn))  # fmt: skip
    ds.attrs["scene"] = "[gripper]\npad_length_mm = 50\npad_width_mm = 22"
    order = [0, 1, 2, 3]
    places = distinct(ds, order, np.array([5.0, 4, 3, 2]), 0)
    assert [(place.best, place.near, place.images) for place in places] == [(0, [1], []), (2, [], []), (3, [], [])]
    assert places[0].within == pytest.approx(0.02, rel=1e-9)
    assert len(distinct(ds, order, np.array([5.0, 4, 3, 2]), 0, top=2)) == 2
    lengths = xr.DataArray([0.02, 0.1], dims="pad_length", attrs={"units": "m", "long_name": "gripper.pad_length_mm"})
    swept = xr.concat([ds, ds], "pad_length").assign_coords(pad_length=lengths)
    scene = text_of(BALL, elements="[8, 4, 2]\npad_width_mm = 22")
    swept.attrs["scene"] = f"{scene}\n[sweep]\n'gripper.pad_length_mm' = [20, 100]"
    places = distinct(swept, range(8), np.array([5.0, 4, 3, 2] * 2), 0)
    assert [(place.best, place.near) for place in places][4:] == [(4, [5]), (6, []), (7, [])]


@pytest.mark.parametrize(("scene", "order"), [(WALL, [1.0, 0.0]), (WALL.replace("preset", "# preset"), [0.0, 1.0])])
def test_a_grasp_that_the_hand_of_the_scene_does_not_reach_comes_last(tmp_path, scene, order):
    """Franka's fingers are 38 mm longer than its palm; the middle of a wall of 140 x 140 mm holds more."""
    axes = formula_results.grid_axes((0, 1), (0.0,), FORCES, poses=True)
    origin, turn = np.zeros((2, 1, 2, 2, 3)), np.zeros((2, 1, 2, 2, 3, 3))
    origin[1, ..., 0], origin[..., 0, 1], origin[..., 1, 1] = 0.06, -0.02, 0.02
    for finger, y in enumerate((1.0, -1.0)):
        turn[..., finger, :, :] = np.column_stack([[1.0, 0, 0], [0, 0, -y], [0, y, 0]])
    path = formula_results.make(
        tmp_path / "wall.hdf", lambda station, angle, force: 2.0 - station, axes, scene, fingers__pose_origin=origin,
        fingers__pose_rotation=turn, payload__ccm=[[[1.0, 5.0]], [[0.5, 2.5]]], opening__opening=0.04,
        opening_loaded__opening_loaded=0.03,
    )  # fmt: skip
    ds = read.open(path)
    table = best(ds, lines=True)
    assert stations(table) == order
    assert judge(ds).attrs["best"] == (int(order[0]), 0, 1)
    points, reached = GraspMap(path).best(2), order[0] == 0.0
    assert [point.place[0, 0] for point in points] == order
    assert [bool(point.flags & Flag.OUT_OF_REACH) for point in points] == [False, not reached]
    assert [case["place"]["station"] for case in chosen(ds)[0]] == order
    with open_result(path) as result:
        assert row_of(result)["best"] == order[0]
        assert np.isfinite(scores_of_poses(result)).all(axis=1).tolist() == [reached, True]
    if not reached:  # where nothing else is left the answer says so, and no other force would help
        alone = best(ds.isel(station=[0]), lines=True).facts["answer"]
        assert Flag.OUT_OF_REACH.sentence in alone["limit"]
    assert any("p00" in note for note in table.notes) == (order[0] == 1.0)
    moved = ds.assign_attrs(scene=ds.attrs["scene"].replace("franka_hand", "moved.toml"))
    assert any("moved.toml cannot be read" in line for line in best(moved).notes) == (not reached)


def test_the_answer_says_what_is_held_and_which_force_holds_a_mass():
    told = best(rising()).facts["answer"]
    assert "1000 g" in told["holds"]
    assert "200 g at 1 N" in told["force"]
    colliding = rising()
    colliding.flags.values[:] = Flag.COLLISION
    assert Flag.COLLISION.sentence in best(colliding).facts["answer"]["limit"]
    low, error = (float(rising(0.3)[name].values[1, 0]) for name in ("force_low", "force_low_error"))
    assert f"{low:.3f} ± {error:.3f} N" in best(rising(0.3)).facts["answer"]["force"]
    weak = rising(0.3)
    weak["force_low_error"] *= np.nan
    weak["force_high"] = weak.force_low.copy(data=np.full(weak.force_low.shape, 2.0))
    told = best(weak).facts["answer"]
    assert told["force"].startswith("none")
    assert "±" not in told["force"]


@pytest.mark.parametrize(("low", "high", "text"), [
    (0.8, 2.5, "0.8..2.5"), (0.8, 5.0, "0.8..5+"), (3.0, 2.5, "none"), (np.nan, np.nan, "-"), (None, 2.5, "..2.5"),
    (np.nan, 2.5, "none"), (3.0, np.nan, "3.."),  # a wall that was taken as rigid
])  # fmt: skip
def test_the_safe_forces_of_a_grasp(low, high, text):
    ds = study([[1.0]], needs=["mass"])
    bounds = {"force_low": low, "force_high": high}
    over = ds.status.dims[:-1]
    ds = ds.assign({name: (over, np.full((1, 1), bound)) for name, bound in bounds.items() if bound is not None})
    assert safe_range(ds, (0, 0, 0)) == text
    assert cells(best(ds), "safe_forces") == [text]
    row = json.loads(as_json(best(ds)))["grasps"][0]
    assert row["force_high"] == (None if np.isnan(high) else high)
    assert "safe_forces" not in row


def test_what_follows_on_a_complete_round_is_the_next_one_and_on_a_complete_run_a_session():
    reasons = "stopped by SIGTERM", ROUND_COMPLETE, ROUND_COMPLETE, "stopped by SIGUSR1", "complete", "complete"
    each = {"start": "2026-01-01T00:00:00", "stop": "2026-01-01T00:01:00", "ranks": 1, "host": "a"}
    stored = [each | {"reason": reason} for reason in reasons]
    heads = [line.split(":")[0].split()[1:] for line in sessions(SimpleNamespace(sessions=stored), False)]
    assert heads == [["1"], ["2"], ["2,", "round", "2"], ["2,", "round", "3"], ["3"], ["4"]]


def test_the_safety_that_is_swept_is_that_of_its_point():
    swept = parse_scene(text_of(BALL), "x.toml", ["object.mass_g=100", "sweep.task.safety=[1, 3]"])
    over, shape = ("safety", "station", "angle", "normal_force"), (2, 1, 1, 1)
    known = {"flags": (over, np.zeros(shape, np.int64)), "status": (over, np.full(shape, DONE)),
             "safety_factor": ((*over, "model"), np.full((*shape, 1), 2.0)),
             "force_low": (over[:-1], np.ones(shape[:-1]))}  # fmt: skip
    safety = xr.DataArray([1.0, 3.0], dims="safety", attrs={"long_name": "task.safety"})
    axes = {"safety": safety, "normal_force": [1.0], "model": ["ccm"]}
    ds = xr.Dataset(known, axes, {"scene": swept.effective_toml()})
    assert (judged(ds) & Flag.TOO_WEAK > 0).ravel().tolist() == [False, True]
    assert [keys_at(ds, (i, 0, 0, 0))["safety"] for i in range(2)] == [1, 3]
    assert (judged(ds.isel(safety=[1])) & Flag.TOO_WEAK > 0).ravel().tolist() == [True]
