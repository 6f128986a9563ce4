"""A number of a scene by its path: its unit, and the model with other values of it."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

from ldcs_ros.physics.model import Model
from ldcs_ros.schema.paths import get_value
from ldcs_ros.simulation.problem import Problem


class SceneNumber:
    """A number of a scene that keeps its nodes and arms when it changes a little.

    Args:
        scene: The scene.
        model: Its model.
        path: Path of the number, such as `effects.payload.mass`.

    Attributes:
        path: The path.
        value: The number.
        unit: Its SI unit, '' where the scene does not say.

    Raises:
        ValueError: There is no number at the path.
    """

    def __init__(self, scene: Problem, model: Model, path: str) -> None:
        self._scene, self._model, self.path = scene, model, path
        words = path.split(".")
        # The last key of an effect, also where an arm of a list has it.
        effect = scene.effect(words[1]) if len(words) > 2 and words[0] == "effects" else None
        declared = {field.name: field for field in fields(effect)} if is_dataclass(effect) else {}
        self.unit = str(declared[words[-1]].metadata.get("unit", "")) if words[-1] in declared else ""
        value = get_value(scene.content, path)
        if value is None:
            value = getattr(effect, words[-1], None)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError(f"got {path!r}, expected a command, or the path of a number of the scene")
        self.value = float(value)

    def step(self, relative: float) -> float:
        """Return a step of differences: a fraction of the number, or of 1 where it is 0."""
        return relative * (abs(self.value) if self.value else 1.0)

    def changed(self, by: float) -> tuple[Problem, Model]:
        """Return the scene and the model with the number changed.

        Raises:
            ValueError: The scene refuses it, or it changes the free coordinates.
        """
        try:
            other = self._scene.edited({self.path: self.value + by})
            model = Model(other.lattice, other.points, other.effects, other.material, like=self._model)
        except Exception as error:
            raise ValueError(f"{self.path} cannot be changed by {by:g}: {error}") from error
        if model.free.tolist() != self._model.free.tolist():
            raise ValueError(
                f"{self.path} changes the lattice, expected a number that keeps its nodes and arms"
            )
        return other, model
