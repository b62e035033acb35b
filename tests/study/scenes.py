"""Scenes of tests: an object, a place, coarse pads; and their cases, solved as a study solves them."""

from softjaw.study import pipeline
from softjaw.study.case.candidates import units as units_of
from softjaw.study.scene import parse_scene

BALL = 'shape = "sphere"\nradius_mm = 30'
OVAL = 'shape = "elliptic_cylinder"\nsemi_axis_a_mm = 25\nsemi_axis_b_mm = 20\nlength_mm = 120'
BOX = 'shape = "box"\nsize_mm = [50, 40, 120]\nedge_radius_mm = 4'
CONE = 'shape = "revolution"\nprofile_mm = [[0, 30], [50, 30], [100, 20], [150, 12]]'
ONE_MESH, NO_COUPLING = "accuracy.meshes=1", 'effects.friction_pressure_coupling="none"'
QUICK = (ONE_MESH, NO_COUPLING)  # friction that acts back is left to tests of its own


def mesh_of(file, unit="mm"):
    return f'shape = "mesh"\nmesh = "{file}"\nunit = "{unit}"'


def pose_of(point=(0, 0, 0), approach=(1, 0, 0), long_side=(0, 0, 1), label=""):
    named = f'label = "{label}"\n' if label else ""
    keys = {"point_mm": point, "approach": approach, "long_side": long_side}
    lines = "".join(f"{key} = {[float(x) for x in value]}\n" for key, value in keys.items())
    return f"[[candidates.poses]]\n{named}{lines}"


def text_of(shape, where=None, *, stations="[0]", angles="[0]", forces="[2]", elements="[8, 4, 2]"):
    """The TOML of a scene; ``where`` stands for stations and angles."""
    place = f"stations_mm = {stations}\nangles_deg = {angles}\n" if where is None else where
    parts = {"object": shape, "gripper": f"elements = {elements}", "load": f"normal_force_n = {forces}"}
    parts["candidates"] = place
    return "".join(f"[{name}]\n{part}\n" for name, part in parts.items())


def scene_of(shape, *changes, **choices):
    return parse_scene(text_of(shape, **choices), "scene.toml", changes)


def results_of(scene):
    return [result for unit in units_of(scene) for _, result in pipeline.solve_unit(unit)]
