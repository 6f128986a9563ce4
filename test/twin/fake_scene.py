"""A scene whose simulation moves on rails: its state is a known function of time."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from ldcs_ros.errors import CommandError, DivergenceError
from ldcs_ros.integrators.settings import Solver

NODES = (3, 2)
SPEED = 0.1  # m/s, upwards
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


class RailInputs:
    def __init__(self, drive):
        self.pressure = np.zeros(2) if drive == "pressure" else None
        self.torque = np.zeros((2, 2)) if drive == "torque" else None
        self.wrenches = {}

    def set_pressure(self, value):
        value = np.broadcast_to(np.asarray(value, dtype=float), (2,))
        if (value > 2.0e5).any():
            raise CommandError("pressure above 200000 Pa")
        self.pressure = value.copy()

    def set_torque(self, value):
        value = np.asarray(value, dtype=float)
        if (np.abs(value) > 1.0).any():
            raise CommandError("torque above 1 N m")
        self.torque = value.copy()

    def check_wrench(self, frame, force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0)):
        if max(np.abs(force)) > 100.0:
            raise CommandError("force above 100 N")

    def set_wrench(self, frame, force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0)):
        self.wrenches[frame] = SimpleNamespace(force=force, torque=torque)

    def clear_wrench(self, frame):
        self.wrenches.pop(frame, None)


@dataclass(frozen=True)
class RailPoint:
    node: int

    def pose(self, position):
        return position[self.node], IDENTITY


class RailSimulation:
    """Rises at SPEED; P0 and P1 are its first and last node; diverges at a time that the scene names."""

    lattice = SimpleNamespace(nodes=NODES, n_nodes=12, missing=np.zeros(0, dtype=int))
    arm_names = ("left", "right")
    joint_names = ("left_joint_1", "left_joint_2", "right_joint_1", "right_joint_2")
    joint_index = np.arange(4)
    joint_torque = np.array([[0.1, 0.2], [0.3, 0.4]])

    def __init__(self, scene):
        self.scene = scene
        self.effects = scene.effects
        self.points = {"P0": RailPoint(0), "P1": RailPoint(-1)}
        self.visited = []
        self.reset()
        specs = {"error_estimate": 0.0, "wall_time": 0.25, "steps": 1, "rejected_steps": 0}
        specs |= {"evaluations": 3, "factorisations": 2}
        self.statistics = SimpleNamespace(as_dict=lambda: {"steps": 1}, **specs)
        self.integrator = SimpleNamespace(name="rails")
        self.last_step = SimpleNamespace(left=SimpleNamespace(time=0.0), right=SimpleNamespace(time=0.125))

    def reset(self):
        self.time = 0.0
        self.inputs = RailInputs(self.scene.drive)

    def advance_to(self, time):
        if time > self.scene.diverges_at:
            raise DivergenceError(f"the simulation diverged at t = {self.scene.diverges_at} s")
        self.visited.append(time)
        self.time = time

    @property
    def state(self):
        position = np.arange(36, dtype=float).reshape(12, 3) * 1e-2
        position[:, 2] += SPEED * self.time
        velocity = np.zeros((12, 3))
        velocity[:, 2] = SPEED
        joints = np.array([[1.0, 2.0], [3.0, 4.0]])
        pressure = np.zeros(2) if self.inputs.pressure is None else self.inputs.pressure
        return SimpleNamespace(
            time=self.time,
            position=position,
            velocity=velocity,
            joint_angle=joints,
            joint_rate=-joints,
            link_angle=np.cumsum(joints, axis=1),
            link_rate=-np.cumsum(joints, axis=1),
            pressure=pressure,
        )

    def pose(self, name):
        if name not in self.points:
            raise ValueError(f"got {name!r}, expected a point out of {list(self.points)}")
        return self.points[name].pose(self.state.position)


@dataclass
class RailScene:
    drive: str = "pressure"
    effects: tuple = ("arms", "wrench")
    sensors: dict = field(default_factory=dict)
    diverges_at: float = float("inf")
    name: str = "rail"
    text: str = "title: rail\n"
    solver: Solver = Solver()

    def build(self):
        return RailSimulation(self)


class Collector(list):
    """A sink that keeps (topic, type, cdr, time_ns)."""

    def __call__(self, *message):
        self.append(message)

    def on(self, topic):
        return [message for message in self if message[0] == topic]
