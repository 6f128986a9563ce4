"""The node's services of ldcs_msgs: apply_wrench, advance, load_scene; imported only where ldcs_msgs is installed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from ldcs_msgs.msg import ArmCommand, LatticeState
from ldcs_msgs.srv import Advance, ApplyWrench, LoadScene
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode
from rclpy.serialization import deserialize_message
from rclpy.task import Future

from ldcs_ros.messages.cdr import encode, header, message_class, nanoseconds
from ldcs_ros.messages.lattice import lattice_state
from ldcs_ros.messages.message_types import TimeMessage, VectorMessage
from ldcs_ros.ros.common.refusals import InvalidStateError, report_errors
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.ros.sim.scene_loader import SceneLoader

MAX_ADVANCE = 10 * 10**9
"""Longest advance of one call [ns of simulation time]."""


class LdcsServices:
    """Serves `~/apply_wrench`, `~/advance` (lock-step for closed loops) and `~/load_scene`.

    Args:
        node: The node that offers them.
        runner: Returns the runner, or raises InactiveNodeError while the node is not active.
        loader: Loader of scenes.
        files: Resolver of paths.
    """

    def __init__(
        self, node: LifecycleNode, runner: Callable[[], Runner], loader: SceneLoader, files: GraphFiles
    ) -> None:
        self._node = node
        self._runner = runner
        self._loader = loader
        self._files = files
        # Other requests are served during an advance, and while a scene is built.
        concurrent = ReentrantCallbackGroup()
        node.create_service(ApplyWrench, "~/apply_wrench", self._apply_wrench)
        node.create_service(Advance, "~/advance", self._advance, callback_group=concurrent)
        node.create_service(LoadScene, "~/load_scene", self._load_scene, callback_group=concurrent)

    def _apply_wrench(
        self, request: ApplyWrench.Request, response: ApplyWrench.Response
    ) -> ApplyWrench.Response:
        with report_errors(self._node, response):
            runner = self._runner()
            apply = partial(
                runner.twin.apply_wrench,
                point=request.point,
                frame_id=request.frame_id,
                force=_components(request.wrench.force),
                torque=_components(request.wrench.torque),
                duration=_nanoseconds(request.duration) / 1e9,
                ramp=_nanoseconds(request.ramp) / 1e9,
            )
            response.message = runner.call(apply)
            response.success = True
        return response

    async def _advance(self, request: Advance.Request, response: Advance.Response) -> Advance.Response:
        with report_errors(self._node, response):
            runner = self._runner()
            duration = _nanoseconds(request.duration)
            if not 0 < duration <= MAX_ADVANCE:
                raise InvalidStateError(
                    f"got a duration of {duration / 1e9:.9g} s, expected above 0 and at most {MAX_ADVANCE / 1e9:g} s"
                )
            command = _arm_command(request.command) if request.command.arms else None
            done: Future[None] = Future(executor=self._node.executor)
            advance = runner.submit(partial(_advance, runner, duration, command))
            advance.add_done_callback(lambda _: done.set_result(None))
            await done
            if advance.cancelled():
                raise InvalidStateError("the node was cleaned up before the end of the advance")
            time, state = advance.result()
            response.state = deserialize_message(state, LatticeState)
            response.success, response.message = True, f"t = {time:.9g} s"
        return response

    async def _load_scene(
        self, request: LoadScene.Request, response: LoadScene.Response
    ) -> LoadScene.Response:
        with report_errors(self._node, response):
            twin, trouble = await self._loader.load(partial(self._files.scene, request.scene))
            title = twin.scene.title or twin.scene.name
            response.success, response.message = True, f"{title}; {trouble}" if trouble else str(title)
            response.effects = list(twin.simulation.effects)
        return response


def _advance(runner: Runner, duration: int, command: bytes | None) -> tuple[float, bytes]:
    time, twin = runner.advance_by(duration, command), runner.twin
    simulation, base = twin.simulation, twin.frames.base
    state = lattice_state(nanoseconds(time), base, simulation.lattice, simulation.arm_names, simulation.state)
    return time, state


def _components(vector: VectorMessage) -> tuple[float, float, float]:
    return (vector.x, vector.y, vector.z)


def _nanoseconds(time: TimeMessage) -> int:
    return time.sec * 10**9 + time.nanosec


def _arm_command(command: ArmCommand) -> bytes:
    # rclpy pads the end of a serialised message; the twin takes bytes as a subscription hands them over.
    return encode(
        message_class("ldcs_msgs/msg/ArmCommand")(
            header=header(_nanoseconds(command.header.stamp), command.header.frame_id),
            sequence=command.sequence,
            arms=list(command.arms),
            pressures=np.array(command.pressures, dtype=np.float64),
            torques=np.array(command.torques, dtype=np.float64),
        )
    )
