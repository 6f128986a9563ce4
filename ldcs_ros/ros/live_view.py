"""`ros2 run ldcs_ros live_view`: a running twin in a browser; `ldcs view --live` becomes this."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from ldcs_ros.errors import LdcsError, ViewingError
from ldcs_ros.ros.common.node_process import own_words, ros_advice, unknown_word

if TYPE_CHECKING:
    from rcl_interfaces.srv import GetParameters
    from rclpy.client import Client
    from rclpy.node import Node
    from rclpy.subscription import MessageInfo
    from rclpy.task import Future

    from ldcs_ros.viewing.live_viewer import LiveViewer
    from ldcs_ros.viewing.rerun_package import Stream
    from ldcs_ros.viewing.web_server import Site

NAME = "live_view"
MEMORY = "1GiB"
_DRAW_PERIOD = 0.04  # s of wall time
_SEARCH_PERIOD = 0.5
_TIMEOUT = 20.0  # s without a twin after which a picture fails
_HINT_AFTER = 5.0
_PICTURE_AFTER = 1.0  # s of drawing


def main(words: list[str] | None = None) -> int:
    """Show a running twin until Ctrl-C or SIGTERM; return the exit status: 0, or 2 for an error."""
    parser = argparse.ArgumentParser(prog=NAME, description=__doc__, allow_abbrev=False)
    parser.add_argument("--namespace", default="/ldcs", help="namespace of the twin")
    parser.add_argument("--port", type=int, default=9090, help="port of the page; 0 for any free one")
    parser.add_argument("--save", type=Path, help="write the view into a .rrd file, too")
    parser.add_argument("--screenshot", type=Path, help="write a picture and end (needs chromium)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, open nothing")
    parser.add_argument(
        "--panel", action="store_true", help="sliders, pushes, pause and recording beside the sheet"
    )
    parser.add_argument(
        "--record", type=Path, default=Path("out/panel"), help="folder of the panel's recordings"
    )
    parser.add_argument("--json", action="store_true", help="print the address as JSON")
    arguments, ros_arguments = parser.parse_known_args(words)
    if unknown := unknown_word(own_words(ros_arguments)):
        print(f"{NAME}: {unknown}", file=sys.stderr)
        return 2
    try:
        return _run(arguments, ros_arguments)
    except ImportError as error:
        print(f"{NAME}: {error}; {ros_advice()}", file=sys.stderr)
    except (LdcsError, RuntimeError, ValueError) as error:
        print(f"{NAME}: {' '.join(str(error).split())}", file=sys.stderr)
    return 2


def _run(arguments: argparse.Namespace, ros_arguments: list[str]) -> int:
    import rclpy
    from rclpy.exceptions import InvalidNamespaceException
    from rclpy.signals import SignalHandlerOptions
    from rclpy.validate_namespace import validate_namespace

    arguments.namespace = "/" + arguments.namespace.strip("/")
    try:
        validate_namespace(arguments.namespace)
    except InvalidNamespaceException as error:
        raise ViewingError(f"namespace {arguments.namespace!r}: {error}") from error
    show = _show_panel if arguments.panel else _show_viewer
    rclpy.init(args=ros_arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        return show(arguments)
    finally:
        rclpy.try_shutdown()


def _show_panel(arguments: argparse.Namespace) -> int:
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    from ldcs_ros.ros.panel import Panel, follow
    from ldcs_ros.viewing.browser_session import open_browser, until_stopped
    from ldcs_ros.viewing.panel_server import panel_site

    node = Node("ldcs_panel", namespace=arguments.namespace)
    panel = Panel(node, arguments.record)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        with until_stopped() as stopped, panel_site(arguments.port, panel) as address:
            _print_address(arguments, address)
            if not arguments.no_browser:
                open_browser(address)
            follow(panel, partial(executor.spin_once, timeout_sec=_DRAW_PERIOD), stopped, _SEARCH_PERIOD)
    finally:
        panel.close()
    return 0


def _show_viewer(arguments: argparse.Namespace) -> int:
    from ldcs_ros.viewing.browser_session import until_stopped
    from ldcs_ros.viewing.rerun_package import program
    from ldcs_ros.viewing.web_server import live_site

    program()
    with until_stopped() as stopped, live_site(arguments.port, memory=MEMORY) as site:
        return _show(arguments, site, stopped)


def _show(arguments: argparse.Namespace, site: Site, stopped: Callable[[float], bool]) -> int:
    from ldcs_ros.viewing.browser_session import open_browser
    from ldcs_ros.viewing.live_viewer import LiveViewer

    _print_address(arguments, site.address)
    if not arguments.no_browser and arguments.screenshot is None:
        open_browser(site.address)
    viewer = LiveViewer(partial(_stream, site.data_url, arguments))
    try:
        return _follow(arguments, site.address, viewer, stopped)
    finally:
        viewer.close()


def _follow(
    arguments: argparse.Namespace, address: str, viewer: LiveViewer, stopped: Callable[[float], bool]
) -> int:
    """Draw messages until a stop signal, or until the picture is taken."""
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    from ldcs_ros.viewing.browser_session import save_picture

    node = Node("ldcs_view", namespace=arguments.namespace)
    listener = Listener(node, viewer)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    began, searched, drawn, first = time.monotonic(), 0.0, 0.0, 0.0
    advice = "start one with `make sim`, or name its namespace: --live NAMESPACE"
    hinted = False
    while not stopped(0.0):
        executor.spin_once(timeout_sec=_DRAW_PERIOD)
        now = time.monotonic()
        if now >= searched + _SEARCH_PERIOD:
            searched = now
            listener.search()
        if now >= drawn + _DRAW_PERIOD:
            drawn = now
            surfaces = viewer.draw()
            first = first or (now if surfaces else 0.0)
        if not (first or hinted) and now > began + _HINT_AFTER:
            hinted = True
            print(f"{NAME}: no twin sends in {arguments.namespace} yet; {advice}", file=sys.stderr)
        if arguments.screenshot is not None:
            if first and now > first + _PICTURE_AFTER:
                save_picture(address, arguments.screenshot)
                return 0
            if not first and now > began + _TIMEOUT:
                raise ViewingError(
                    f"no twin sent a surface in {arguments.namespace} within {_TIMEOUT:g} s; {advice}"
                )
    return 0


class Listener:
    """Subscribes to the topics of a view as they appear, and asks the twin for the pressure of its air.

    Args:
        node: The node that listens, in the twin's namespace.
        viewer: Receiver of the messages.
    """

    def __init__(self, node: Node, viewer: LiveViewer) -> None:
        self._node = node
        self._viewer = viewer
        from rcl_interfaces.srv import GetParameters

        self._heard: set[str] = set()
        self._parameters: Client[GetParameters.Request, GetParameters.Response] = node.create_client(
            GetParameters, "ldcs_sim/get_parameters"
        )
        self._request = GetParameters.Request(names=["ambient_pressure"])
        self._asked = False

    def search(self) -> None:
        """Subscribe to new topics, and ask once."""
        from rclpy.qos import QoSProfile, ReliabilityPolicy

        from ldcs_ros.ros.common.transport import subscribe_raw
        from ldcs_ros.viewing.live_viewer import is_shown

        if not self._asked and self._parameters.service_is_ready():
            self._asked = True
            self._parameters.call_async(self._request).add_done_callback(self._take_ambient)
        prefix = self._node.get_namespace().rstrip("/") + "/"
        # A best-effort subscription receives from every publisher, and a slow view delays none.
        quality = QoSProfile(depth=20, reliability=ReliabilityPolicy.BEST_EFFORT)
        for topic, types in self._node.get_topic_names_and_types():
            name = topic.removeprefix(prefix)
            if topic in self._heard or name == topic or not types or not is_shown(name, types[0]):
                continue
            if find_spec(types[0].split("/")[0]) is not None:
                self._heard.add(topic)
                callback = partial(self._take, name, types[0])
                subscribe_raw(self._node, types[0], topic, callback, quality)

    def _take_ambient(self, asked: Future[GetParameters.Response]) -> None:
        answer = asked.result()
        if answer is not None and answer.values:
            self._viewer.ambient_pressure = answer.values[0].double_value

    def _take(self, name: str, kind: str, cdr: bytes, info: MessageInfo) -> None:
        self._viewer.receive(name, kind, cdr)


def _stream(url: str, arguments: argparse.Namespace) -> Stream:
    from ldcs_ros.viewing.rerun_package import new_stream, rerun

    stream = new_stream(f"twin in {arguments.namespace}")
    sinks = [rerun().GrpcSink(url)]
    if arguments.save is not None:
        arguments.save.parent.mkdir(parents=True, exist_ok=True)
        sinks.append(rerun().FileSink(str(arguments.save)))
    stream.set_sinks(*sinks)
    return stream


def _print_address(arguments: argparse.Namespace, address: str) -> None:
    if arguments.json:
        print(json.dumps({"namespace": arguments.namespace, "url": address}), flush=True)
    else:
        print(f"the twin in {arguments.namespace} is shown at {address}   (Ctrl-C ends it)", flush=True)


if __name__ == "__main__":
    sys.exit(main())
