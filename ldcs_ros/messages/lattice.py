"""The whole sheet as messages: the cloud of nodes in single precision, and the state in full precision."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ldcs_ros.messages.cdr import MessageTemplate, encode, header, message_class, placeholder
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.state import State

CLOUD_FIELDS = ("x", "y", "z", "vx", "vy", "vz")
_FLOAT32 = 7


class NodeCloud:
    """Builds `nodes`: an organised PointCloud2, rows layer by layer then along x, columns along y.

    Args:
        nodes: Number of nodes along x and along y.
        frame: Name of the base frame.
        is_dense: Whether all nodes exist; those in holes are NaN.
    """

    def __init__(self, nodes: tuple[int, int], frame: str = BASE_FRAME, *, is_dense: bool = True) -> None:
        nx, ny = nodes
        point_step = 4 * len(CLOUD_FIELDS)
        self._numbers = np.empty((2 * nx * ny, len(CLOUD_FIELDS)), dtype="<f4")
        point_field = message_class("sensor_msgs/msg/PointField")
        message = message_class("sensor_msgs/msg/PointCloud2")(
            header=header(0, frame),
            height=2 * nx,
            width=ny,
            fields=[
                point_field(name=name, offset=4 * place, datatype=_FLOAT32, count=1)
                for place, name in enumerate(CLOUD_FIELDS)
            ],
            is_bigendian=False,
            point_step=point_step,
            row_step=point_step * ny,
            data=placeholder(self._numbers.nbytes),
            is_dense=is_dense,
        )
        self._message = MessageTemplate(message, self._numbers.nbytes)

    def build(self, time_ns: int, position: np.ndarray, velocity: np.ndarray) -> bytes:
        """Return the message for positions [m] and velocities [m/s] of shape (n_nodes, 3)."""
        self._numbers[:, :3] = position
        self._numbers[:, 3:] = velocity
        return self._message.fill(time_ns, self._numbers)


def lattice_state(time_ns: int, frame: str, lattice: Lattice, arms: Sequence[str], state: State) -> bytes:
    """Return a LatticeState of a state in float64, in a frame; `arms` holds the names of the arms."""
    nx, ny = lattice.nodes
    return encode(
        message_class("ldcs_msgs/msg/LatticeState")(
            header=header(time_ns, frame),
            nodes_x=nx,
            nodes_y=ny,
            position=_flat(state.position),
            velocity=_flat(state.velocity),
            arms=list(arms),
            links=state.link_angle.shape[1] if arms else 0,
            link_angle=_flat(state.link_angle),
            link_rate=_flat(state.link_rate),
            pressure=_flat(state.pressure),
        )
    )


def _flat(values: np.ndarray) -> np.ndarray:
    return np.ravel(np.asarray(values, dtype=np.float64))
