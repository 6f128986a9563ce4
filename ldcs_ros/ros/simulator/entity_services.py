"""GetEntities, GetEntitiesStates, GetEntityState and GetEntityInfo: the parts of the scene and their motion."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Vector3
from simulation_interfaces.msg import EntityCategory, EntityState, Result

from ldcs_ros.messages.cdr import nanoseconds
from ldcs_ros.ros.common.refusals import InactiveNodeError
from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.ros.simulator.answers import ResultError, TagFilter
from ldcs_ros.ros.simulator.control import Host
from ldcs_ros.ros.simulator.entities import Entities, Entity, Instant, Kind, Kinematics
from ldcs_ros.ros.simulator.filters import Box, NameFilter, Region, Sphere

if TYPE_CHECKING:
    from simulation_interfaces.msg import Bounds, EntityFilters
    from simulation_interfaces.srv import (
        GetEntities,
        GetEntitiesStates,
        GetEntityInfo,
        GetEntityState,
        SetEntityState,
    )

    from ldcs_ros.simulation.simulation import Simulation


class EntityServices:
    """Answers for the entities of the runner's twin, also while the node is inactive.

    Args:
        host: The node.
    """

    def __init__(self, host: Host) -> None:
        self._host = host
        self._simulation: Simulation | None = None

    def names(self, request: GetEntities.Request, response: GetEntities.Response) -> None:
        """List the entities that pass the filters."""
        response.entities = [entity.name for entity in self._chosen(request.filters, None)]

    def states(self, request: GetEntitiesStates.Request, response: GetEntitiesStates.Response) -> None:
        """List the entities that pass the filters, and their states at one instant."""
        time, kinematics = self._look()
        chosen = self._chosen(request.filters, kinematics)
        response.entities = [entity.name for entity in chosen]
        response.states = [self._state(entity, time, kinematics) for entity in chosen]

    def state(self, request: GetEntityState.Request, response: GetEntityState.Response) -> None:
        """Report the state of one entity."""
        entity = self._named(request.entity)
        response.state = self._state(entity, *self._look())

    def info(self, request: GetEntityInfo.Request, response: GetEntityInfo.Response) -> None:
        """Report category, description and tags of an entity."""
        entity = self._named(request.entity)
        response.info.category.category = _category(entity)
        response.info.description = entity.description
        response.info.tags = list(entity.tags)

    def refuse_to_set(self, request: SetEntityState.Request, response: SetEntityState.Response) -> None:
        """Refuse to move an entity by hand: raise ResultError."""
        raise ResultError(
            Result.RESULT_FEATURE_UNSUPPORTED,
            "entities cannot be moved by hand: a run must be repeatable from its bag; "
            "move the sheet by commands, or by external_wrench",
        )

    def _entities(self) -> Entities:
        simulation = self._runner().twin.simulation
        if self._simulation is not simulation:
            self._found, self._simulation = Entities(simulation), simulation
        return self._found

    def _runner(self) -> Runner:
        if self._host.runner is None:
            raise InactiveNodeError("no scene is loaded; configure the node first")
        return self._host.runner

    def _look(self) -> tuple[int, Kinematics]:
        # Only the copy is made on the runner's thread, which has deadlines.
        entities = self._entities()
        instant: Instant = self._runner().call(entities.instant)
        return nanoseconds(instant.time), entities.kinematics(instant)

    def _named(self, name: str) -> Entity:
        entity = self._entities().all.get(name)
        if entity is None:
            reason = (
                f"no entity {name!r}; GetEntities lists them: points, node_<layer>_<i>_<j>, <arm>_link_<k>"
            )
            raise ResultError(Result.RESULT_NOT_FOUND, reason)
        return entity

    def _chosen(self, filters: EntityFilters, kinematics: Kinematics | None) -> list[Entity]:
        tags = TagFilter(filters.tags)
        try:
            names = NameFilter(filters.filter)
            region = region_of(filters.bounds)
        except ValueError as error:
            raise ResultError(Result.RESULT_OPERATION_FAILED, str(error)) from error
        everywhere = None
        if region is not None:
            ends = (kinematics or self._look()[1]).ends
            everywhere = region.intersects(ends[:, 0], ends[:, 1])
        categories = {one.category for one in filters.categories}
        return [
            entity
            for entity in self._entities().all.values()
            if names.matches(entity.name)
            and (not categories or _category(entity) in categories)
            and tags.matches(entity.tags)
            and (everywhere is None or everywhere[entity.row])
        ]

    def _state(self, entity: Entity, time: int, kinematics: Kinematics) -> EntityState:
        state, row = EntityState(), entity.row
        state.header.frame_id = self._runner().twin.frames.base
        state.header.stamp.sec, state.header.stamp.nanosec = divmod(time, 10**9)
        position, orientation = state.pose.position, state.pose.orientation
        position.x, position.y, position.z = kinematics.position[row].tolist()
        orientation.x, orientation.y, orientation.z, orientation.w = kinematics.orientation(row)
        state.twist.linear, state.twist.angular = _vectors(
            kinematics.velocity[row], kinematics.angular_velocity[row]
        )
        accelerations = _vectors(kinematics.acceleration[row], kinematics.angular_acceleration[row])
        state.acceleration.linear, state.acceleration.angular = accelerations
        return state


def region_of(bounds: Bounds) -> Region | None:
    """Return the region of a message Bounds; None for one without bounds.

    Raises:
        ResultError: Its type is not supported.
        ValueError: Its points do not fit its type.
    """
    kinds: dict[int, type[Region]] = {bounds.TYPE_BOX: Box, bounds.TYPE_SPHERE: Sphere}
    if bounds.type == bounds.TYPE_EMPTY:
        return None
    if bounds.type not in kinds:
        reason = f"bounds of type {bounds.type}, expected a box ({bounds.TYPE_BOX}) or a sphere ({bounds.TYPE_SPHERE})"
        raise ResultError(Result.RESULT_FEATURE_UNSUPPORTED, reason)
    return kinds[bounds.type].of([(point.x, point.y, point.z) for point in bounds.points])


def _category(entity: Entity) -> int:
    if entity.kind is Kind.LINK:
        return int(EntityCategory.CATEGORY_ROBOT)
    return int(EntityCategory.CATEGORY_STATIC_OBJECT if entity.still else EntityCategory.CATEGORY_OBJECT)


def _vectors(*vectors: np.ndarray) -> Iterable[Vector3]:
    return [Vector3(x=x, y=y, z=z) for x, y, z in (vector.tolist() for vector in vectors)]
