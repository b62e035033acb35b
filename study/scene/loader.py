"""``Scene.load``: a function of the class `Scene`, whose instances have their section ``[load]`` under this name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, overload

from softjaw.study.scene.section import SceneSection
from softjaw.study.scene.sections import Load

if TYPE_CHECKING:
    from softjaw.study.scene.model import Scene


class Loader(type(SceneSection)):  # type: ignore[misc]
    """Gives the class `Scene` a function that its instances have a section for: ``Scene.load``."""

    def load(cls, file: str | Path, overrides: Sequence[str] = ()) -> Scene:
        """The scene of a file.

        Parameters
        ----------
        file : path
            Scene as TOML; a mesh that it names is looked for from the file's folder.
        overrides : sequence of str
            ``section.key=value`` as behind ``--set``.

        Raises
        ------
        SceneError
            With every problem found, each a sentence with file, line and key. It is a `ValueError`.

        Examples
        --------
        >>> Scene.load("jobs/smoke.toml", ["gripper.pad_width_mm=20"]).gripper.pad_width
        0.02
        """
        from softjaw.study.scene.load import load_scene  # which makes scenes, so it stands above this module

        return load_scene(file, overrides)


if TYPE_CHECKING:

    class SectionOrLoader(Protocol):
        """What ``load`` is of a scene, and of the class `Scene`."""

        @overload
        def __get__(self, scene: None, owner: type[Scene], /) -> Callable[..., Scene]: ...
        @overload
        def __get__(self, scene: Scene, owner: type[Scene], /) -> Load: ...

else:
    SectionOrLoader = Load
