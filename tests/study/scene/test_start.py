"""``softjaw init``: what it writes passes ``check`` and runs, replaces nothing, and knows its mesh."""

import tomllib

import pytest
import trimesh

from softjaw.study.cli import main
from softjaw.study.cli.options import KINDS
from softjaw.study.messages import CANNOT_WRITE, USAGE
from softjaw.study.scene import load_scene
from tests.objects.bodies import SCANS
from tests.study.launching import ROOT

FLASK = ROOT / "jobs" / "objects" / "flask.stl"
SMALL = {  # what makes a run of a second or two of each kind
    "bottle": ["candidates.stations=2", "load.normal_force_n=[2]"],
    "cup": ["candidates.stations=2", "load.normal_force_n=[0.5]", "effects.object='rigid'"],
    "cylinder": ["load.normal_force_n=[3]", "accuracy.meshes=1"],
    "mesh": ["candidates.sampled=2", "load.normal_force_n=[2]"],
}  # fmt: skip


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    """Each test in a folder of its own."""
    monkeypatch.chdir(tmp_path)


def started(kind, *more):
    return main(["init", kind, *(["--mesh", str(FLASK), "--unit", "mm"] if kind == "mesh" else []), *more])


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_passes_check(kind, tmp_path, capsys):
    assert started(kind, "-o", "mine") == 0
    assert "softjaw check mine.toml" in capsys.readouterr().out
    text = (tmp_path / "mine.toml").read_text()
    assert "@" not in text
    assert tomllib.loads(text)["object"]["name"] == "mine"
    assert max(map(len, text.splitlines())) <= 120
    assert main(["check", "mine.toml"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "no errors" in told
    assert "warning" not in told


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_runs(kind, tmp_path):
    assert started(kind, "-o", "mine") == 0
    changes = [word for change in ["gripper.elements=[8,4,2]", *SMALL[kind]] for word in ("--set", change)]
    assert main(["run", "mine.toml", *changes]) == 0
    assert (tmp_path / "results" / "mine.hdf").exists()


def test_lines_behind_a_number_sign_count_a_mesh_gets_a_sampler_and_a_banana_is_held_along_its_axis(tmp_path, capsys):
    assert started("bottle") == 0
    path = tmp_path / "bottle.toml"
    lines = [line[2:] if line.startswith("# ") and " = " in line else line for line in path.read_text().splitlines()]
    path.write_text("\n".join(lines))
    scene = load_scene(path)
    assert (scene.object.wall_mm, scene.object.allowed_dent_mm) == (0.4, 3)
    # The flask is 120 mm high and 49.7 mm wide along y; stations that fit it stand in comments.
    assert started("mesh", "-o", "sub/flask") == 0
    scene = load_scene(tmp_path / "sub" / "flask.toml")
    assert scene.candidates.sampled == 20
    proposed = "# stations_mm = [25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0, 95.0]"
    assert proposed in (tmp_path / "sub" / "flask.toml").read_text()
    assert (scene.gripper.pad_length_mm, scene.gripper.pad_width_mm) == (50, 22)
    assert (tmp_path / "sub" / scene.object.mesh).resolve() == FLASK.resolve()
    assert started("mesh", "-o", "lying.toml", "--axis", "y") == 0
    lying = load_scene(tmp_path / "lying.toml")
    assert (lying.object.axis, lying.gripper.pad_length_mm) == ("y", 50)
    assert "stations_mm" not in (tmp_path / "lying.toml").read_text()
    assert main(["init", "mesh", "--mesh", str(SCANS / "ycb_011_banana.stl"), "--unit", "m", "-o", "b"]) == 0
    text = (tmp_path / "b.toml").read_text().replace("\nsampled", "\n# sampled")  # with its stations instead
    (tmp_path / "b.toml").write_text(text.replace("\n# stations_mm", "\nstations_mm").replace("\n# angles", "\nangles"))
    scene = load_scene("b.toml")
    assert scene.object.axis == "x"
    assert 4 <= len(scene.candidates.station_values_mm) <= 8
    assert scene.candidates.total <= 24
    assert main(["check", "b.toml"]) == 0
    assert "warning" not in capsys.readouterr().out
    (tmp_path / "b.toml").write_text((tmp_path / "b.toml").read_text().replace("# refine =", "refine ="))
    assert load_scene("b.toml").candidates.refine == 36


@pytest.mark.parametrize("ending", ["glb", "gltf", "3mf", "off"])
def test_a_mesh_of_any_format_is_started_in_metres_where_its_format_says_so(ending, tmp_path, capsys):
    (tmp_path / "open").mkdir()
    body = trimesh.creation.box((0.05, 0.04, 0.09))
    if ending == "off":  # parts that cross are closed, and their centroid is an estimate all the same
        body += trimesh.creation.icosphere(2, 0.03).apply_translation([0.02, 0, 0])
    else:
        body.faces = body.faces[2:]
    body.export(tmp_path / "open" / f"body.{ending}")
    unit = [] if ending in ("glb", "gltf") else ["--unit", "m"]
    assert main(["init", "mesh", "--mesh", f"open/body.{ending}", *unit]) == 0
    assert "centroid estimated" in capsys.readouterr().out
    assert load_scene("body.toml").object.unit == "m"
    assert ending != "glb" or main(["check", "body.toml"]) == 0


@pytest.mark.parametrize("there", ["bottle.toml", "bottle.sbatch"])
def test_nothing_is_replaced_unasked(tmp_path, there, capsys):
    (tmp_path / there).write_text("mine")
    assert started("bottle") == CANNOT_WRITE
    assert f"{there}: exists already" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [there]
    assert (tmp_path / there).read_text() == "mine"
    assert started("bottle", "--force") == 0
    assert (tmp_path / there).read_text() != "mine"


@pytest.mark.parametrize(("words", "told"), [
    ([], "{bottle,cup,cylinder,mesh}"), (["botle"], "did you mean 'bottle'?"),
    (["mesh"], "a mesh needs --mesh FILE and --unit"), (["mesh", "--mesh", str(FLASK)], "a mesh needs --unit"),
    (["mesh", "--mesh", str(FLASK), "--unit", "inch"], 'the unit may be "mm"'),
    (["mesh", "--mesh", "no.stl", "--unit", "mm"], "no.stl"), (["mesh", "--mesh", "."], "--objects ."),
    (["cup", "--mesh", str(FLASK)], "--mesh: found beside 'cup'"), (["cup", "--axis", "x"], "--axis: "),
    (["bottle", "--unit", "inch"], "--unit: found beside 'bottle'"), (["cup", "-o", "$(rm -r .)"], "expected letters"),
    (["cup", "-o", 'a"b'], "expected letters"),
])  # fmt: skip
def test_what_cannot_be_started_is_refused_and_writes_nothing(words, told, tmp_path, capsys):
    assert main(["init", *words]) == USAGE
    assert told in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
