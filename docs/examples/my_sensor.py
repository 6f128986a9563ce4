"""A sensor of your own beside a twin: a draw-wire to P1, 200 times a second, with noise, recorded in the same bag."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.bags import read_bag
from ldcs_ros.messages.cdr import encode, header, message_class, nanoseconds
from ldcs_ros.messages.topics import Topic
from ldcs_ros.sensors import Ticks
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.twin import Twin

WIRE = Topic("wire", "sensor_msgs/msg/Range", "out", "length of the wire to P1 [m]")


class DrawWire:
    """Measures the distance from a fixed eye to a position.

    Args:
        rate: Measurements a second [Hz].
        noise: Standard deviation [m].
        generator: Source of the noise.
    """

    def __init__(self, rate: float, noise: float, generator: np.random.Generator) -> None:
        self.eye = np.array([0.140, 0.0, 0.300])  # m, in ldcs_base: above the free edge
        self.ticks, self.noise, self.generator = Ticks(rate), noise, generator

    def measure(self, position: np.ndarray) -> float:
        """Return the reported length [m] at the present tick, and go on to the next."""
        self.ticks.advance()
        return float(np.linalg.norm(position - self.eye) + self.noise * self.generator.normal())


if __name__ == "__main__":
    twin = Twin(load_scene("paper"))
    twin.topics[WIRE.name] = WIRE  # before the recorder opens its bag
    folder = Path(tempfile.mkdtemp()) / "bag"
    twin.sinks.append(recorder := Recorder(folder, twin))
    sensor = DrawWire(200.0, 1.0e-4, np.random.default_rng(7))
    while (time := sensor.ticks.time) <= 2.0:
        twin.advance_to(time)
        length = sensor.measure(twin.simulation.pose("P1")[0])
        message = message_class(WIRE.type)(
            header=header(nanoseconds(time), "wire_eye"),
            radiation_type=1,
            field_of_view=0.0,
            min_range=0.0,
            max_range=1.0,
            range=length,
            variance=sensor.noise**2,
        )
        twin.emit(WIRE, encode(message), nanoseconds(time))
    recorder.close()
    channel = read_bag(folder).channels["/ldcs/wire"]
    print(f"{len(channel.times)} lengths in the bag, the last one {1e3 * channel.messages[-1].range:.1f} mm")
