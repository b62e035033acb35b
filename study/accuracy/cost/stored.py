"""What a result file says of the settings that ``accuracy.e_n`` chose; imports next to nothing, as a plan needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softjaw.study.result.layout import Derived
from softjaw.study.scene import Scene
from softjaw.study.scene.text import toml_text

if TYPE_CHECKING:
    from softjaw.study.accuracy.cost.choose import Choice

PREDICTED, MEASURED, HELD_OUT = "e_n_error_predicted", "e_n_error_on_probes", "e_n_error_held_out"
SECONDS = "seconds_per_case_predicted"
MEANING = {
    PREDICTED: ("", "predicted relative error of e_n", "Largest relative error of e_n that the cost study predicts for"
                " the settings that accuracy.e_n chose: the sum over its knobs, or that of the chosen mesh."),
    MEASURED: ("", "relative error of e_n on probe cases", "Largest relative error of e_n of the chosen settings on the"
               " probe cases, against the limit of finer ones and with what that limit may be off. NaN: they were not"
               " solved there."),
    HELD_OUT: ("", "relative error of e_n on other cases", "The same on cases that the settings were not chosen by."
               " NaN: there were none, or the target was missed before."),
    SECONDS: ("s", "predicted CPU time of one case", "CPU time of one case with the chosen settings, on the probes."),
}  # fmt: skip


def derived(scene: Scene) -> list[Derived]:
    """Four numbers where the scene names a target."""
    if scene.accuracy.e_n is None:
        return []
    return [Derived(name, *words, shape=(1,)) for name, words in MEANING.items()]


def fill(writer: Any, choice: Choice | None) -> None:
    """Write them, by one rank, after all cases."""
    if choice is not None:
        values = (choice.predicted, choice.measured, choice.held_out, choice.seconds)
        for name, value in zip(MEANING, values, strict=True):
            writer.write_derived(name, value)


def overrides(choice: Choice | None) -> list[str]:
    """The chosen values as overrides that say where they come from."""
    if choice is None:
        return []
    texts = [toml_text({"x": {"x": value}}).splitlines()[1].partition(" = ")[2] for value in choice.values.values()]
    made = [f"{key}={text}  # chosen" for key, text in zip(choice.values, texts, strict=True)]
    return [*made, f"# {choice}"]
