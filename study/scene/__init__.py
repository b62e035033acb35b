"""The scene: what a user asks for, read from a TOML file, validated, frozen."""

from softjaw.study.scene.load import load_scene, parse_scene
from softjaw.study.scene.model import Option, Scene
from softjaw.study.scene.problems import Problem, SceneError

__all__ = ["Option", "Problem", "Scene", "SceneError", "load_scene", "parse_scene"]
