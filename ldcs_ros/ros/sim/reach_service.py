"""The node's service `~/reach`: which commands give these places or this shape; an offline search beside the twin."""

from __future__ import annotations

from collections.abc import Callable

from ldcs_msgs.srv import Reach
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode

from ldcs_ros.errors import CommandError
from ldcs_ros.reach import Reached, TargetCoordinate, Variable, reach, shape_target
from ldcs_ros.ros.common.background import in_background
from ldcs_ros.ros.common.refusals import InvalidStateError, report_errors
from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.scene.scene import Scene

MOST_STARTS = 32
MOST_TARGETS = 1000
MOST_VARIABLES = 256


class ReachService:
    """Serves `~/reach`, one search at a time, on a thread of its own.

    Args:
        node: The node that offers it.
        runner: Returns the runner, or raises InactiveNodeError while the node is not active.
    """

    def __init__(self, node: LifecycleNode, runner: Callable[[], Runner]) -> None:
        self._node, self._runner = node, runner
        self._busy = False
        node.create_service(Reach, "~/reach", self._reach, callback_group=ReentrantCallbackGroup())

    async def _reach(self, request: Reach.Request, response: Reach.Response) -> Reach.Response:
        with report_errors(self._node, response):
            scene = self._runner().twin.scene
            if self._busy:
                raise InvalidStateError("another search is under way; try again")
            self._busy = True
            try:
                found = await in_background(self._node, lambda: _search(scene, request), "reach")
            finally:
                self._busy = False
            if found is None:
                raise InvalidStateError("the node was cleaned up before the end of the search")
            best = found[0]
            response.commands = list(best.commands.values())
            response.reached = list(best.reached.values())
            response.distance, response.optimality = best.distance, best.optimality
            response.stable, response.at_bounds = best.stable, list(best.at_bounds)
            response.sensitivity = best.sensitivity.ravel().tolist()
            response.solutions = len(found)
            response.success, response.message = True, _summary(best)
        return response


def _search(scene: Scene, request: Reach.Request) -> list[Reached]:
    targets = _targets(request)
    if not len(request.variables) == len(request.lower) == len(request.upper) <= MOST_VARIABLES:
        raise CommandError(
            f"got {len(request.variables)} variables, {len(request.lower)} lower and {len(request.upper)} upper "
            f"bounds, expected as many of each, at most {MOST_VARIABLES}"
        )
    variables = [Variable(*one) for one in zip(request.variables, request.lower, request.upper, strict=True)]
    if request.starts > MOST_STARTS:
        raise CommandError(f"got {request.starts} starts, expected at most {MOST_STARTS}")
    if ".csv" in request.shape:
        raise CommandError(
            "got a file as the shape, expected one such as 'sphere:radius=0.5'; use `ldcs reach`"
        )
    simulation = scene.build()
    simulation.settle()
    try:
        shape = shape_target(request.shape, scene.lattice) if request.shape else None
        return reach(
            simulation,
            targets,
            variables,
            shape=shape,
            starts=max(request.starts, 1),
            seed=request.seed,
        )
    except ValueError as error:
        raise CommandError(str(error)) from error


def _targets(request: Reach.Request) -> list[TargetCoordinate]:
    names, values = list(request.targets), list(request.values)
    weights = list(request.weights) or [1.0] * len(names)
    if not len(names) == len(values) == len(weights) <= MOST_TARGETS:
        raise CommandError(
            f"got {len(names)} targets, {len(values)} values and {len(weights)} weights, expected as many of each, at "
            f"most {MOST_TARGETS}"
        )
    targets = []
    for name, value, weight in zip(names, values, weights, strict=True):
        place, _, axis = name.rpartition(".")
        targets.append(TargetCoordinate(place, axis, value, weight))
    return targets


def _summary(best: Reached) -> str:
    commands = ", ".join(f"{name} = {value:.6g}" for name, value in best.commands.items())
    bounds = f", held by bounds: {', '.join(best.at_bounds)}" if best.at_bounds else ""
    branch = "stable" if best.stable else "unstable"
    return f"{commands}; {1e3 * best.distance:.4g} mm remain{bounds}; {branch}"
