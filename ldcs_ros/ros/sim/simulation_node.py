"""The live twin as a lifecycle node: parameters, transport and recorder around a runner; no physics."""

from __future__ import annotations

import sys
import threading
import time
import traceback
from functools import partial
from typing import TYPE_CHECKING

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from ldcs_ros import load_scene
from ldcs_ros.errors import LdcsError, SceneError
from ldcs_ros.ros.common.optional import installed, interface_states, missing_line
from ldcs_ros.ros.common.parameters import ParameterNode
from ldcs_ros.ros.common.qos import check_overrides
from ldcs_ros.ros.common.refusals import InactiveNodeError, InvalidStateError
from ldcs_ros.ros.common.transport import TopicTransport
from ldcs_ros.ros.sim import parameters
from ldcs_ros.ros.sim.graph_checks import ClockMonitor, DuplicateNodeCheck, sim_time_error
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.sim.pacing import Pacer, tolerance
from ldcs_ros.ros.sim.recording_session import RecordingSession
from ldcs_ros.ros.sim.runner import PeriodicTask, Runner
from ldcs_ros.ros.sim.scene_loader import SceneLoader
from ldcs_ros.ros.sim.services import Services
from ldcs_ros.ros.sim.status import StatusLine, health
from ldcs_ros.scene.load import shipped_scenes
from ldcs_ros.scene.scene import Scene
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin
from ldcs_ros.twin.warm_up import warm_up
from ldcs_ros.twin.watchdog import Watchdog

if TYPE_CHECKING:
    from rclpy.parameter import AllowableParameterValue, Parameter

    from ldcs_ros.ros.simulator.services import SimulatorServices

NODE_NAME = "ldcs_sim"
DEFAULT_NAMESPACE = "/ldcs"
DIAGNOSTICS_PERIOD = 1.0
INACTIVE = "the node is inactive; activate it first"


class SimulationNode(ParameterNode, LifecycleNode):
    """The node: builds a twin when configured, lets its time run while active.

    Attributes:
        finished: Set when the duration is over, or the node was shut down.
        problem: Error of the last configuration that failed; None for none.
    """

    # rclpy destroys a node that was refused before it had this attribute.
    _simulator: SimulatorServices | None = None

    def __init__(self) -> None:
        super().__init__(NODE_NAME, namespace=DEFAULT_NAMESPACE, start_parameter_services=False)
        self.declare_table(parameters.PARAMETERS)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._parameters_changed)
        self.finished = threading.Event()
        self.problem: LdcsError | None = None
        self._transport = TopicTransport(self)
        self._clock_monitor = ClockMonitor(self)
        self._duplicate_nodes = DuplicateNodeCheck(self)
        self._runner: Runner | None = None
        self._bag = RecordingSession(self.get_logger())
        self._status: StatusLine | None = None
        self._interfaces: dict[str, str] = {}
        self._is_active = False
        self._triggers = Services(self, self.active_runner)
        self._scenes = SceneLoader(self, self.active_runner, build=self._twin_of, swap_scene=self._swap_scene)
        self._files = GraphFiles(self.value("graph_folder"), self.get_logger())
        # A value given at the start is the operator's; one that is set later comes from the graph.
        self._given = {name: self.value(name) for name in ("scene", "record")}
        self._offer_own_services()
        self._simulator = self._offer_simulator_services()

    @classmethod
    def started(cls) -> SimulationNode:
        """Return a node that is active, or unconfigured if its parameter `autostart` is false.

        Raises:
            LdcsError: It could not be configured.
        """
        node, done = cls(), TransitionCallbackReturn.SUCCESS
        if node.value("autostart"):
            if node.trigger_configure() is not done or node.trigger_activate() is not done:
                node.stop()
                node.destroy_node()
                raise node.problem or LdcsError("the node could not be started")
        return node

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Build the twin, join the graph and start recording."""
        try:
            self._check_setting()
            self._start(self._twin_of(self._asked_scene()))
        except LdcsError as error:
            self.get_logger().error(str(error))
            self.problem = error
            self.stop()
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            # The lifecycle of rclpy would swallow it; an unexpected exception is logged.
            self.get_logger().error(traceback.format_exc())
            self.problem = LdcsError(f"the node could not be configured: {error!r}")
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let time run and take commands."""
        runner = self._runner
        assert runner is not None
        try:
            runner.call(runner.resume)
        except InvalidStateError as error:
            # A failed run is active all the same: reset, a service of the active node, restarts it.
            self.get_logger().warning(str(error))
            if not runner.failure:
                return TransitionCallbackReturn.FAILURE
        runner.refusal_reason, self._is_active = "", True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop time and refuse commands; the graph and the bag stay."""
        runner = self._runner
        assert runner is not None
        try:
            runner.call(runner.pause)
        except InvalidStateError as error:
            self.get_logger().warning(str(error))
            return TransitionCallbackReturn.FAILURE
        runner.refusal_reason, self._is_active = INACTIVE, False
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent, close the bag and leave the graph."""
        self.stop()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do the same, and end the process."""
        self.stop()
        self.finished.set()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """After an error in a transition: back to unconfigured."""
        self.stop()
        return TransitionCallbackReturn.SUCCESS

    def stop(self) -> None:
        """Vent the arms, close the bag, leave the graph; may be called again."""
        self._is_active = False
        if self._runner is not None:
            self._runner.stop()
            self._runner = None
        if self._status is not None:
            self._status.close()
            self._status = None
        self._bag.close()
        self._transport.close()

    @property
    def failure(self) -> str:
        """Reason why the run ends with status 1: an incomplete recording; '' otherwise."""
        return self._bag.failure

    @property
    def runner(self) -> Runner | None:
        """The runner of the twin; None while the node is unconfigured."""
        return self._runner

    def active_runner(self) -> Runner:
        """Return the runner of the twin, for requests that change it.

        Raises:
            InactiveNodeError: The node is not active.
        """
        if self._runner is None:
            raise InactiveNodeError("the node is unconfigured; configure and activate it first")
        if not self._is_active:
            raise InactiveNodeError(INACTIVE)
        return self._runner

    def destroy_node(self) -> None:
        """Leave the graph."""
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None
        super().destroy_node()

    def _offer_simulator_services(self) -> SimulatorServices | None:
        if not installed()["simulation_interfaces"]:
            return None
        try:
            from ldcs_ros.ros.simulator.services import SimulatorServices
        except ImportError as error:
            self.get_logger().warning(f"simulation_interfaces cannot be used: {error}")
            return None
        return SimulatorServices(self, self, self._scenes, self._files)

    def _offer_own_services(self) -> None:
        if not installed()["ldcs_msgs"]:
            return
        from ldcs_ros.ros.sim.ldcs_services import LdcsServices
        from ldcs_ros.ros.sim.reach_service import ReachService

        LdcsServices(self, self.active_runner, self._scenes, self._files)
        ReachService(self, self.active_runner)

    def _check_setting(self) -> None:
        present = installed()
        used = {name for name in ("ldcs_msgs",) if present[name]}
        if self._simulator is not None:
            used.add("simulation_interfaces")
        if self.value("publish_tf") and present["tf2_msgs"]:
            used.add("tf2_msgs")
        self._interfaces = interface_states(used)
        missing = missing_line()
        if missing:
            self.get_logger().info(missing)
        validation_error = sim_time_error(
            use_sim_time=self.value("use_sim_time"), publish_clock=self.value("publish_clock")
        )
        if validation_error:
            raise LdcsError(validation_error)

    def _twin_of(self, scene: Scene) -> Twin:
        timeouts = {
            "timeout": self.value("command_timeout"),
            "wrench_timeout": self.value("wrench_timeout"),
        }
        settings = RunSettings(
            seed=None if self.value("seed") < 0 else self.value("seed"),
            accuracy=self.value("accuracy") or None,
            tracker_rate=self.value("tracker_rate") or None,
            publish_rate=self.value("publish_rate"),
            ambient_pressure=self.value("ambient_pressure"),
            publish_clock=self.value("publish_clock"),
            publish_tf=self.value("publish_tf") and installed()["tf2_msgs"],
            frame_prefix=self.value("frame_prefix"),
            full_precision=self.value("record_detail"),
            verify=self.value("verify"),
        )
        twin = Twin(
            scene,
            settings,
            has_subscribers=self._transport.has_subscribers,
            watchdog=Watchdog(time.monotonic, **timeouts),
            diagnostics=False,
        )
        warm_up(twin.scene, commanded=True)  # before the clock runs, not in its first period
        if scene.points and "tracker" not in scene.sensors:
            self.get_logger().info(
                "the scene has no tracker under sensors, so nothing is sent on POINT/pose; "
                "truth/POINT/pose has the exact places"
            )
        return twin

    def _start(self, twin: Twin) -> None:
        factor, rate = self.value("real_time_factor"), self.value("publish_rate")
        runner = Runner(
            twin,
            Pacer(factor, tolerance=tolerance(rate, factor)),
            duration=self.value("duration"),
            on_failure=self._log_failure,
            on_finish=self.finished.set,
            on_reset=self._start_next_bag,
        )
        runner.refusal_reason = INACTIVE
        for unknown in check_overrides(self, twin.topics.values()):
            self.get_logger().warning(unknown)
        if twin.settings.publish_clock:
            self._clock_monitor.refuse_second()
        self._join_graph(twin, runner)
        self._bag.start(self._asked_folder(), twin, self.get_namespace())
        self._runner, self._status = runner, StatusLine(sys.stderr, runner)
        period = self._status.period
        runner.periodic_tasks += [
            PeriodicTask(DIAGNOSTICS_PERIOD, self._report_health),
            PeriodicTask(period, self._status.show, delay=period),
        ]
        runner.start()

    def _join_graph(self, twin: Twin, runner: Runner) -> None:
        # The bag keeps the quality of service that each publisher offers.
        twin.topics |= self._transport.open(twin.topics.values(), runner.post)
        twin.sinks.append(self._transport)

    def _swap_scene(self, twin: Twin, *, stop: bool) -> str:
        runner = self.active_runner()
        self._join_graph(twin, runner)
        change_bag = partial(self._bag.change_twin, runner.twin, twin)
        runner.call(partial(runner.swap_scene, twin, change_bag, stop=stop))
        self._transport.keep(twin.topics)
        return self._bag.error

    def _log_failure(self, reason: str) -> None:
        self.get_logger().error(f"{reason}; paused, call reset")

    def _report_health(self) -> None:
        runner = self._runner
        if runner is not None:
            self._bag.watch()
            missed = self._transport.missed
            statuses = health(runner, self._bag.recorder, self._bag.error, self._interfaces, missed)
            statuses.append(self._duplicate_nodes.status())
            if runner.twin.settings.publish_clock:
                statuses.append(self._clock_monitor.status())
            runner.twin.emit_diagnostics(self.get_fully_qualified_name(), statuses)

    def _start_next_bag(self) -> None:
        if self._runner is not None:
            self._bag.start_next(self._runner.twin)

    def _check_parameters(self, changes: list[Parameter[AllowableParameterValue]]) -> SetParametersResult:
        given = {name: self.value(name) for name in ("use_sim_time", "publish_clock")}
        given |= {change.name: change.value for change in changes if change.name in given}
        validation_error = sim_time_error(**given)
        if validation_error:
            return SetParametersResult(successful=False, reason=validation_error)
        try:
            for change in changes:
                self._check_path(change)
        except SceneError as error:
            return SetParametersResult(successful=False, reason=f"parameter {change.name}: {error}")
        return parameters.check(changes, configured=self._runner is not None)

    def _asked_scene(self) -> Scene:
        name = self.value("scene")
        return load_scene(name) if name == self._given["scene"] else self._files.scene(name)

    def _asked_folder(self) -> str:
        folder = self.value("record")
        return str(folder if folder in ("", self._given["record"]) else self._files.path(folder))

    def _check_path(self, change: Parameter[AllowableParameterValue]) -> None:
        if change.name not in self._given or change.value in ("", self._given[change.name]):
            return
        if change.name == "record" or change.value not in shipped_scenes():
            self._files.path(str(change.value))

    def _parameters_changed(self, changes: list[Parameter[AllowableParameterValue]]) -> None:
        runner = self._runner
        if runner is None:
            return
        changed = {one.name: self.value(one.name) for one in changes if one.name in parameters.PARAMETERS}

        def apply() -> None:
            watchdog, pacer = runner.twin.watchdog, runner.pacer
            watchdog.timeout = changed.get("command_timeout", watchdog.timeout)
            watchdog.wrench_timeout = changed.get("wrench_timeout", watchdog.wrench_timeout)
            runner.duration = changed.get("duration", runner.duration)
            if "real_time_factor" in changed:
                pacer.real_time_factor = changed["real_time_factor"]
                pacer.tolerance = tolerance(runner.twin.settings.publish_rate, pacer.real_time_factor)
                pacer.reset()

        runner.submit(apply)
