"""The scene: what a user asks for, read from a TOML file, validated, frozen."""

from softjaw.study.scene.errors import SceneError
from softjaw.study.scene.model import Option, Scene, load_scene, parse_scene

__all__ = ["Option", "Scene", "SceneError", "load_scene", "parse_scene"]
