"""A bench for bridge tests: the mock rig with a small sheet and the bridge, joined by a real transport."""

from __future__ import annotations

import time

import numpy as np
import yaml

from ldcs_ros import load_scene
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.mock_rig.modbus_server import ModbusServer
from ldcs_ros.mock_rig.rig import Hidden, MockRig, hidden_scene
from ldcs_ros.mock_rig.serial_port import SerialPort
from ldcs_ros.mock_rig.server import MockRigServer
from ldcs_ros.mock_rig.topics import Topics
from ldcs_ros.rig.bridge import Bridge
from ldcs_ros.rig.gate import GateState, Mode
from ldcs_ros.rig.health import Health
from ldcs_ros.rig.link import Link
from ldcs_ros.rig.output.stage import OutputStage
from ldcs_ros.rig.output.topics import TopicDevice
from ldcs_ros.rig.rig_file import load_rig
from ldcs_ros.rig.topic_link import TopicLink

LIMIT = 140e3
WORKING = 80e3
SMALL = {
    "lattice": {"size": [0.140, 0.140, 0.010], "nodes": [5, 5], "mass": 0.160},
    "points": {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]},
    "effects": [
        {"type": "springs", "law": "axial", "stiffness": 80.0, "damping": 5.0},
        {"type": "gravity"},
        {"type": "clamp", "edge": "x_min"},
        {
            "type": "arms",
            "drive": "pressure",
            "pressure_gain": 1.0e-6,
            "fill_time": 0.15,
            "vent_time": 0.10,
            "dead_time": 0.02,
        },
    ],
    "sensors": {"tracker": {"points": ["P0", "P1"], "rate": 80.0}, "pressure": {"rate": 100.0}},
    "solver": {"integrator": "auto", "accuracy": 1.0e-4},
}


THREE = {
    **SMALL,
    "effects": [
        *SMALL["effects"][:3],
        {
            **SMALL["effects"][3],
            "arms": [
                {"name": "left", "from": [0.0, 0.07], "to": [0.14, 0.07]},
                {"name": "middle", "from": [0.0, 0.0], "to": [0.07, 0.0], "pressure_gain": 8.0e-7},
                {"name": "right", "from": [0.0, -0.07], "to": [0.14, -0.07]},
            ],
        },
    ],
}


class HandClock:
    """A steady clock that is turned by hand."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def pass_time(self, duration):
        self.now += duration


class InlineOutput(Link):
    """An output stage in the test's own process; readings of the listener are read-backs of the device."""

    commands = True

    def __init__(self, device, limits, clock, listener):
        super().__init__("topic output", clock)
        self.stage = OutputStage(device, limits, clock, commands=True)
        self._listener = listener
        self.connected = True
        receive = listener.receive

        def hear(topic, cdr, heard=None):
            before = len(listener._readings)
            receive(topic, cdr, heard)
            for reading in list(listener._readings)[before:]:
                if reading.kind != "position":
                    device.report(reading.kind, reading.name, float(reading.value))

        listener.receive = hear

    def send(self, pressure, epoch):
        self.stage.set_target(list(pressure), epoch, self.clock())

    def vent(self, reason, epoch):
        self.stage.vent(reason, epoch)

    def work(self):
        self.stage.step()
        self.status = self.stage.exchange().status
        self.connected, self.error = self.status.connected, self.status.error


class Bench:
    """Rig and bridge. With a HandClock and topics nothing waits; else time is real and links have threads."""

    def __init__(
        self, transport, *, mode="live", clock=None, controller="remote", hidden=None, scene=SMALL, limits=None
    ):
        self.clock = clock or time.monotonic
        self.by_hand = clock is not None
        scene = load_scene(scene)
        self.rig = MockRig(hidden_scene(scene, hidden or Hidden()), clock=self.clock, controller=controller)
        self.topics = Topics(self.rig, self._to_bridge, pressures=transport == "topics")
        self.port = {"modbus": ModbusServer, "serial": SerialPort}.get(transport)
        self.port = self.port(self.rig) if self.port else None
        self.stand = MockRigServer(self.rig, [one for one in (self.port, self.topics) if one])
        self._receive = lambda topic, cdr: None
        if not self.by_hand:
            self.stand.start()
        self.rig_file = load_rig(yaml.safe_load(self.stand.rig_file(limits or {})))
        links = self._inline(Mode(mode)) if self.by_hand else None
        self.bridge = Bridge(scene, self.rig_file, mode=Mode(mode), clock=self.clock, links=links)
        self.health = Health(self.bridge)
        for link in self.bridge.links:
            if link.name == "topics":
                self._receive = link.receive
        if self.by_hand:
            self.bridge.validator.restart(self.clock())
        else:
            self.bridge.start()
        self.operator = None
        self.refused = ""

    def close(self):
        if not self.by_hand:
            self.bridge.stop()
            self.stand.stop()

    def run(self, duration, until=None):
        """Let time pass, the operator command at 100 Hz; return how long it took until the condition held."""
        start = self.clock()
        while self.clock() - start < duration:
            if self.operator is not None:
                try:
                    self.bridge.command(self.operator)
                except ValueError as error:
                    self.refused = str(error)
            self.bridge.step()
            if self.by_hand:
                self.clock.pass_time(0.01)
                self.rig.advance()
                self.topics.work()
                for link in self.bridge.links:
                    if link.commands:
                        link.work()
            else:
                time.sleep(0.008)
            if until is not None and until():
                return self.clock() - start
        assert until is None, f"did not happen in {duration} s"
        return duration

    def pressurise(self, *pressure):
        """Arm it and bring the arms to pressures [Pa], or all to the working pressure."""
        self.run(5.0, lambda: not self.bridge.preconditions())
        self.bridge.arm()
        self.operator = list(pressure or [WORKING] * len(self.rig.pressure))
        self.run(5.0, lambda: (self.rig.pressure > 0.9 * np.array(self.operator)).all())

    def is_empty(self, *arms):
        """Whether the chambers of these arms (or of all) are empty."""
        names = list(self.rig.simulation.arm_names)
        pressure = self.rig.pressure[[names.index(arm) for arm in arms or names]]
        return bool(pressure.max() < 0.05 * LIMIT)

    @property
    def vented(self):
        return self.bridge.gate.state is GateState.VENTED

    def seen(self):
        """Return the diagnostics: levels and texts by name."""
        return {status.name: (status.level, status.message) for status in self.health.read()}

    def check_limits(self):
        """Neither set-points nor chambers ever left their limits."""
        assert self.rig.lowest_setpoint >= 0.0
        assert self.rig.highest_setpoint <= LIMIT
        assert self.rig.peak <= LIMIT * (1.0 + 1e-9)
        assert np.isfinite(self.rig.pressure).all()

    def _to_bridge(self, topic, kind, cdr):
        self._receive(topic, cdr)

    def _inline(self, mode):
        """Links of a rig on topics without a process: the output stage is stepped by hand."""
        (settings,) = self.rig_file.links
        listener = TopicLink(settings.receive, self.clock)
        if mode is not Mode.LIVE:
            return [listener]
        device = TopicDevice(
            lambda values: self.topics.receive(pressure_command(np.array(values))),
            settings.send.unit,
            self.clock,
            rate=settings.rate,
            reads_back=True,
        )
        output = InlineOutput(device, self.rig_file.limits, self.clock, listener)
        return [listener, output]
