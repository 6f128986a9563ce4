"""`Scene`: the frozen, checked content of one scene file."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ldcs_ros.errors import SceneError, SolverError
from ldcs_ros.integrators.settings import Solver
from ldcs_ros.physics.effects.base import Effect
from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Point
from ldcs_ros.scene import schema
from ldcs_ros.scene.mesh_change import carry_places
from ldcs_ros.schema.paths import put_value, remove_value
from ldcs_ros.schema.reader import plain_values, read_yaml, write_yaml

if TYPE_CHECKING:
    # A scene without a material loads none.
    from ldcs_ros.physics.material import Material
    from ldcs_ros.simulation.simulation import Simulation


@dataclass(frozen=True)
class Scene:
    """The content of one scene file; `build` makes a simulation of it.

    Attributes:
        name: Name of the shipped scene or stem of the file.
        title: One line for people.
        lattice: The lattice.
        points: Named points.
        effects: The effects, in the file's order.
        inputs: Schedule of commands, by time.
        sensors: Parameters of each sensor by name; empty means that none is computed.
        solver: Settings of the integration.
        material: Material of the sheet, if it is not given by mass, stiffness and damping.
        values: The scene as plain values with the keys of a scene file; `content` is a copy.
        source: The YAML text that it was read from; None if it was edited.
    """

    name: str
    title: str
    lattice: Lattice
    points: dict[str, Point]
    effects: tuple[Effect, ...]
    inputs: tuple[ScheduledCommand, ...] = ()
    sensors: dict[str, dict[str, Any]] = field(default_factory=dict)
    solver: Solver = Solver()
    material: Material | None = None
    values: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)
    source: str | None = field(default=None, compare=False, repr=False)

    @property
    def content(self) -> dict[str, Any]:
        """The scene as plain values with the keys of a scene file; a new copy at each access."""
        return {key: _copied(value) for key, value in self.values.items()}

    @cached_property
    def text(self) -> str:
        """The scene as YAML text, for bags."""
        return write_yaml(self.values) if self.source is None else self.source

    def has_same(self, content: Mapping[str, object], keys: Iterable[str]) -> bool:
        """Return whether a content has the scene's values, of the same types, at some top-level keys."""
        return all(repr(content.get(key)) == repr(self.values.get(key)) for key in keys)

    def edited(self, changes: Mapping[str, object] | None = None, /, **keys: object) -> Scene:
        """Return a checked scene with other values at some paths, under the same name.

        Args:
            changes: Values by path, such as `{"effects.springs.stiffness": 90.0}`; None removes a key.
            **keys: Values of top-level keys, such as `inputs=None`.

        Places that are node numbers keep their places on another mesh, with a warning for each.

        Raises:
            SceneError: A path does not exist, a place has no node on the new mesh, or the changed scene is not valid.
        """
        changed = {**(changes or {}), **keys}
        content = self.content
        for path, value in changed.items():
            if value is None:
                remove_value(content, path)
            else:
                put_value(content, path, plain_values(value, origin=path, error=SceneError))
        for line in carry_places(self.values, content):
            warnings.warn(f"{self.name}: {line}", stacklevel=2)
        return _checked_scene(content, None, self.name, self.name, like=self) if changed else self

    # Any: the fields of an effect are those of the class of that name.
    def effect(self, name: str) -> Any:
        """Return the scene's effect of a name, or None."""
        return next((effect for effect in self.effects if effect.name == name), None)

    def without_schedule(self) -> Scene:
        """Return the scene without its schedule of commands; the scene itself if it has none."""
        return self.edited(inputs=None) if self.inputs else self

    def stiffened(self, factor: float) -> Scene:
        """Return the scene with a factor on the stiffness of its springs, a material's too; dampers stay."""
        if self.material is None:
            return self.edited({"effects.springs.stiffness": factor * self.effect("springs").stiffness})
        return self.edited(
            {
                "material.youngs_modulus": factor * self.material.youngs_modulus,
                "material.relaxation_time": self.material.relaxation_time / factor,
            }
        )

    def with_accuracy(self, accuracy: float) -> Scene:
        """Return the same scene with adaptive steps of the same method at another accuracy [m]."""
        solver: dict[str, object] = {"integrator": self.solver.integrator, "accuracy": accuracy}
        if self.solver.verify:
            solver["verify"] = True
        if self.solver.commands != Solver.commands:
            solver["commands"] = self.solver.commands
        return self.edited(solver=solver)

    def build(self, *, verify: bool = False) -> Simulation:
        """Return a simulation of the scene at its start.

        Args:
            verify: A second solution at a tenth of the accuracy measures the error as it goes; so it does if the
                scene says `solver: {verify: true}`.

        Raises:
            SolverError: A fixed step has no accuracy to verify.
        """
        from ldcs_ros.simulation.simulation import Simulation

        if verify or self.solver.verify:
            from ldcs_ros.simulation.verification import FINER, VerifiedSimulation

            if self.solver.accuracy is None:
                raise SolverError(
                    "verify: got a fixed step, expected an accuracy; compare runs of two steps instead @ solver.dt"
                )
            finest = Solver.__dataclass_fields__["accuracy"].metadata["low"]
            finer = self.with_accuracy(max(FINER * self.solver.accuracy, finest))
            return VerifiedSimulation(self, finer)
        return Simulation(self)


def _copied(value: object) -> object:
    if isinstance(value, dict):
        return {key: _copied(item) for key, item in value.items()}
    return [_copied(item) for item in value] if isinstance(value, list) else value


def parse_scene(text: str, *, name: str, origin: str) -> Scene:
    """Return the scene of a YAML text; `origin` names the source in errors.

    Raises:
        SceneError: The text is not a valid scene.
    """
    return _checked_scene(read_yaml(text, origin=origin, error=SceneError), text, name, origin)


def _checked_scene(
    content: object, source: str | None, name: str, origin: str, *, like: Scene | None = None
) -> Scene:
    try:
        return scene_of_content(content, source, name=name, like=like)
    except SceneError as error:
        message = str(error)
        raise SceneError(
            message if origin in message else message.replace(" @ ", f" @ {origin}: ", 1)
        ) from error


def scene_of_content(content: object, source: str | None, *, name: str, like: Scene | None = None) -> Scene:
    """Return the scene of plain values, which it keeps.

    Args:
        content: The plain values.
        source: The text that they were read from, if any.
        name: Name of the scene.
        like: A scene that shares its sheet and points with this one, where both say the same of them.

    Raises:
        SceneError: The content is not a valid scene.
    """
    block = schema.CHECKS.keys(content, schema.TOP_KEYS, "", required=("lattice", "effects"))
    sheet = ("lattice", "material", "points")
    if like is not None and like.has_same(block, sheet):
        material, lattice, points = like.material, like.lattice, like.points
    else:
        material = schema.check_material(block["material"], "material") if "material" in block else None
        lattice = schema.check_lattice(block["lattice"], material, "lattice")
        points = schema.check_points(block.get("points", {}), lattice, "points")
    return Scene(
        name=name,
        title=schema.CHECKS.text(block.get("title", name), "title"),
        lattice=lattice,
        points=points,
        effects=schema.check_effects(block["effects"], lattice, points, "effects"),
        inputs=schema.check_inputs(block.get("inputs", []), "inputs"),
        sensors=schema.check_sensors(block.get("sensors", {}), lattice, points, "sensors"),
        solver=schema.check_solver(block["solver"], "solver") if "solver" in block else Solver(),
        material=material,
        values=block,
        source=source,
    )
