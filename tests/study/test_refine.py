"""Refinement of the stations: where the next ones go, what a grown file keeps, and the same bits on any ranks."""

from __future__ import annotations

from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from softjaw.study.result.layout import DONE, MISSING
from softjaw.study.result.skeleton import rewrite
from softjaw.study.result.store import open_result, torn_rows
from softjaw.study.run.plan import make_plan, measured_seconds
from softjaw.study.run.refine import FINEST_SPACING_SHARE, chances, next_stations
from softjaw.study.scene import parse_scene
from tests.study.launching import contents, differing, launch

GIVEN = np.linspace(25.0, 175.0, 35)
BEST_WITHIN = 0.02


def tent(x, peak, width):
    """A map with one steep peak on a plateau, one force."""
    return 0.05 + 0.15 * np.maximum(1 - np.abs(x - peak) / width, 0.0)


def rounds_until_known(formula, budget=30):
    """Stations that are added before nothing is expected to be better, by the rule of a study."""
    asked = SimpleNamespace(refine=budget, refine_within=BEST_WITHIN)
    scene = SimpleNamespace(candidates=asked)
    asked.station_values_mm = GIVEN.tolist()
    added = []
    while True:
        stations = np.array(sorted([*GIVEN, *(s for some in added for s in some)]))
        values = {"payload/ccm": formula(stations)[:, None, None], "flags/flags": np.zeros((len(stations), 1, 1))}
        result = SimpleNamespace(
            layout=SimpleNamespace(added=tuple(added), shape=(len(stations), 1, 1)), read=values.get,
            axes=[SimpleNamespace(values=1e-3 * stations), None, None], status=np.full((len(stations), 1, 1), DONE),
        )  # fmt: skip
        more = next_stations(result, scene, 1)
        if not more:
            return [s for some in added for s in some], formula(stations).max()
        added.append(more)


@pytest.mark.parametrize("peak", [66.75, 67.6, 69.0, 100.0, 171.0])
@pytest.mark.parametrize("width", [4.0, 6.0, 20.0])
def test_the_best_of_a_steep_peak_is_found(peak, width):
    """Half as wide as the stations are apart, and wider."""
    added, best = rounds_until_known(lambda x: tent(x, peak, width))
    assert best > 0.2 * (1 - BEST_WITHIN)
    assert 1 <= len(added) <= 20
    assert np.abs(np.array(added) - peak).max() < 12 + width


def test_nothing_is_added_where_nothing_can_be_gained():
    assert rounds_until_known(lambda x: 0.1 + 1e-4 * x)[0] == []
    assert rounds_until_known(lambda x: np.full(x.shape, np.nan))[0] == []


def test_a_jump_is_followed_to_the_finest_distance_and_no_further():
    added, _ = rounds_until_known(lambda x: np.where(x < 90.0, 0.1, 0.2))
    assert len(added) < 16
    assert np.diff(sorted([*GIVEN, *added])).min() > 0.9 * FINEST_SPACING_SHARE * np.diff(GIVEN)[0]


def test_a_budget_is_kept():
    assert len(rounds_until_known(lambda x: tent(x, 66.75, 4.0), budget=3)[0]) == 3


def test_grasps_that_cannot_be_used_are_no_best_ones():
    stations, score = np.arange(4.0), np.array([1.0, 2.0, 9.0, 1.0]).reshape(1, 4, 1, 1)
    sound = np.array([True, True, False, False]).reshape(1, 4, 1, 1)
    found = chances(stations, score, sound, 0.1)
    assert found[0] > 0  # judged against 2, not 9
    assert found[2] == 0  # both ends cannot be used


SCENE = """
[object]
shape = "revolution"
profile_mm = [[0, 30], [20, 30], [40, 26], [50, 25], [60, 26], [80, 30], [100, 30]]
[gripper]
elements = [8, 4, 2]
[candidates]
stations_mm = [28, 38, 46, 54, 64]
angles_deg = [0, 90]
refine = 12
refine_within = 0.02
[load]
normal_force_n = [1, 2]
[limit_surface]
samples = 80
wrench_samples = [2, "54 mm, 90 deg"]
"""


def test_a_grown_file_keeps_every_row(tmp_path):
    scene, path = parse_scene(SCENE), tmp_path / "a.hdf"
    small, big = (make_plan(scene, rounds=rounds) for rounds in ((), ((50.0,), (33.0, 42.0))))
    assert big.header.digest == small.header.digest == scene.digest
    assert big.layout.sampled == (4, 13)  # stations 38 and 54 mm among eight
    filled(path, small)
    with open_result(path) as before:
        old = {d.path: before.file.values(before.file.plain(d.path)) for d in before.layout.datasets}
        labels = before.labels
    with h5py.File(path, "r+") as file:
        file["study/e_n/ccm"][1, 0, 0] = 7.0  # torn
    rewrite(path, big.layout, big.header)
    own = [0, 2, 4, 6, 7]
    with open_result(path, unchecked=True) as after:
        assert after.layout.added == ((50.0,), (33.0, 42.0))
        assert after.axes[-3].values == pytest.approx(1e-3 * np.array([28, 33, 38, 42, 46, 50, 54, 64]))
        assert (after.codes[[1, 3, 5]] == MISSING).all()
        assert (after.codes[own] == DONE).all()
        assert (after.labels[[0, 2, 4, 6, 7]] == labels).all()
        for name in ("study/patch/pressure", "study/quality/ccm"):
            found = after.file.values(after.file.plain(f"/{name}"))
            assert found[own].tobytes() == old[f"/{name}"].tobytes()
    assert torn_rows(path, big.layout) == [2 * 2 * 2]
    assert not list(tmp_path.glob("*.grown*"))
    assert measured_seconds(small.layout, path).shape == (20,)


def filled(path, plan):
    """A file of this plan with numbers of a formula in every row."""
    from softjaw.study.case.result import CaseResult
    from softjaw.study.result.skeleton import create
    from softjaw.study.result.write import ResultWriter, record

    create(path, plan.layout, plan.header)
    writer = ResultWriter(path, plan.layout, None)
    for row in range(plan.layout.rows):
        random = np.random.default_rng(row)
        values = {f"maps/{name}": random.random(3) for name in ("quality", "e_n")} | {"maps/flags": 0.0}
        patch = {"pressure": random.random((2, plan.layout.faces))}
        values["wrenches/wrench"] = random.random((2, 3, plan.layout.samples, 3))
        writer.write(row, record(plan.layout, CaseResult(values, patch)))
    writer.close()


def refined(scene, name, ranks, *words):
    """A run of a scene into a file beside it: the file, and what was said."""
    path = scene.parent / name
    code, output, errors = launch(ranks, "-m", "softjaw", "run", scene, "-o", path, *words)
    assert code == 0, errors
    return path, output


def same_bits(scene, expected, own):
    """Two and three ranks, and a study that is refined late, give these contents; ``own`` cases come first."""
    for ranks in (2, 3):
        assert differing(refined(scene, f"{ranks}.hdf", ranks)[0], expected) == []
    # First without, then with refinement: what is solved stays.
    late, first = refined(scene, "late.hdf", 2, "--set", "candidates.refine=false")
    assert "round" not in first
    assert f"0 of {own} cases to solve" in refined(scene, "late.hdf", 2)[1]
    assert differing(late, expected) == []


@pytest.mark.long
@pytest.mark.ranks
def test_a_refined_study_has_the_same_bits_on_any_number_of_ranks(tmp_path):
    scene = tmp_path / "vase.toml"

    def compare():
        scene.write_text(SCENE)
        alone, _ = refined(scene, "alone.hdf", 0)
        with open_result(alone) as result:
            assert 2 <= len(result.layout.added) <= sum(map(len, result.layout.added)) == 6  # 12 cases on a round body
            best = result.read("quality/ccm")[..., -1].max()
        assert best > 0.6  # 0.19 at the scene's own stations
        same_bits(scene, contents(alone), 20)
        assert "0 of 44 cases to solve" in refined(scene, "alone.hdf", 2)[1]

    compare()
