"""The scene: what a user asks for, read from a TOML file, validated, frozen."""

from softjaw.study.scene.model import Option, Scene, load_scene, parse_scene
from softjaw.study.scene.section import SceneError

__all__ = ["Option", "Scene", "SceneError", "load_scene", "parse_scene"]
