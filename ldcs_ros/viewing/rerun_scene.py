"""RerunScene: the surface, arms, loads, points and curves of a bag or of a running twin in a rerun recording."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb

from ldcs_ros.messages.display import colours
from ldcs_ros.messages.display.colours import of_height
from ldcs_ros.messages.display.loads import rotate
from ldcs_ros.messages.display.marker import (
    ARROW,
    CYLINDER,
    LINE_STRIP,
    SPHERE,
    SPHERE_LIST,
    TEXT,
    MarkerSpec,
)
from ldcs_ros.messages.display.surface import triangles
from ldcs_ros.plotting.style import AXIS_COLOURS, LINE_COLOURS
from ldcs_ros.viewing.rerun_package import Stream, rerun


class ShadedMesh:
    """Both layers and the walls; a node has a corner for each direction of its faces, so that edges stay sharp.

    Args:
        nodes: Number of nodes along x and along y.
        missing: Nodes in holes.

    Attributes:
        triangles: Corners of each triangle, anticlockwise seen from outside, shape (n_triangles, 3).
    """

    def __init__(self, nodes: tuple[int, int], missing: np.ndarray | None = None) -> None:
        nx, ny = nodes
        by_node = triangles(nodes, missing)
        layer, i, j = np.unravel_index(by_node, (2, nx, ny))
        a, b, c = np.moveaxis(np.stack([i, j, layer], axis=-1), 1, 0)
        # On the grid of indices normals are unit vectors: -3 ... 3 tells the six directions apart.
        face = 3 + np.cross(b - a, c - a) @ np.array([1, 2, 3])
        corner = face[:, None] * (2 * nx * ny) + by_node
        known, index = np.unique(corner, return_inverse=True)
        self._node = known % (2 * nx * ny)
        self.triangles = index.reshape(-1, 3).astype(np.uint32)

    def corners(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return places [m] and unit normals of the corners, shape (n_corners, 3) each, float32.

        Args:
            position: Node positions [m], shape (n_nodes, 3).
        """
        place = position[self._node].astype(np.float32)
        a, b, c = (place[self.triangles[:, k]] for k in range(3))
        across = np.cross(b - a, c - a)
        normal = np.zeros_like(place)
        for k in range(3):
            np.add.at(normal, self.triangles[:, k], across)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        return place, normal / np.maximum(size, 1e-20)

    def colours(self, position: np.ndarray, length: float) -> np.ndarray:
        """Return the colours of the corners by height, red, green, blue, opacity 0 ... 255, shape (n_corners, 4)."""
        by_node = of_height(position[:, 2], length)
        return np.uint8(np.round(255.0 * by_node[self._node]))


TIMELINE = "time"
SURFACE, NODES, ARMS, LOADS = "sheet/surface", "sheet/nodes", "arms", "loads"
POINTS, TRACES, PLOTS = "points", "traces", "plots"

_NODE_RADIUS, _POINT_RADIUS, _TRACE_RADIUS = 0.0006, 0.0032, 0.0007  # m
_NODE_COLOUR = (30, 30, 30, 255)


class RerunScene:
    """A writer of surface, markers, points and curves; each call has one time or a column of times.

    Args:
        stream: A rerun recording stream.
        length: Length of the sheet along x, which scales the colours [m]; None takes it from the first sheet.

    Attributes:
        plots: Path of each plot by its title, in the order of their first curve.
    """

    def __init__(self, stream: Stream, *, length: float | None = None) -> None:
        self._rr = rerun()
        self._stream = stream
        self._length = length
        self._meshes: dict[tuple[int, int], ShadedMesh] = {}
        self._static: set[str] = set()
        self._colours = CurveColours()
        self._shown: set[str] = set()
        self._last_place: dict[str, np.ndarray] = {}
        self.plots: dict[str, str] = {}
        stream.log("/", self._rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    @property
    def point_names(self) -> list[str]:
        """Names of all points so far."""
        return sorted(self._last_place)

    def sheet(self, time: float, nodes: tuple[int, int], position: np.ndarray) -> None:
        """Show the sheet at a time [s]: node positions [m], shape (n_nodes, 3), nodes along x and y."""
        if self._length is None:
            # Along its bottom, whose length bending does not change; nodes in holes are NaN.
            rows = position.reshape(2, *nodes, 3)[0]
            cell = np.nanmean(np.linalg.norm(np.diff(rows, axis=0), axis=-1))
            self._length = float(cell * (nodes[0] - 1))
        missing = np.isnan(position).any(axis=1)
        if nodes not in self._meshes:
            self._meshes[nodes] = ShadedMesh(nodes, np.flatnonzero(missing))
        mesh = self._meshes[nodes]
        rr, stream = self._rr, self._stream
        stream.set_time(TIMELINE, duration=time)
        if SURFACE not in self._static:
            self._static.add(SURFACE)
            stream.log(SURFACE, rr.Mesh3D.from_fields(triangle_indices=mesh.triangles), static=True)
            style = rr.Points3D.from_fields(radii=_NODE_RADIUS, colors=[_NODE_COLOUR])
            stream.log(NODES, style, static=True)
        place, normal = mesh.corners(position)
        painted = mesh.colours(position, self._length)
        stream.log(
            SURFACE,
            rr.Mesh3D.from_fields(vertex_positions=place, vertex_normals=normal, vertex_colors=painted),
        )
        stream.log(NODES, rr.Points3D.from_fields(positions=position[~missing].astype(np.float32)))

    def specs(self, entity: str, time: float, specs: Iterable[MarkerSpec]) -> None:
        """Show the markers of a topic at a time [s]; they replace its earlier ones."""
        self._stream.set_time(TIMELINE, duration=time)
        by_kind: dict[str, list[MarkerSpec]] = {
            "lines": [],
            "links": [],
            "balls": [],
            "arrows": [],
            "labels": [],
        }
        for spec in specs:
            by_kind[_KINDS[spec.kind]].append(spec)
        for kind, some in by_kind.items():
            path = f"{entity}/{kind}"
            # An empty archetype removes the earlier markers of its kind.
            if some or path in self._shown:
                self._stream.log(path, self._archetype(kind, some))
                self._shown.add(path)

    def points(self, times: np.ndarray, places: dict[str, np.ndarray]) -> None:
        """Show named points and extend their traces.

        Args:
            times: Times [s], shape (n,).
            places: Positions [m], shape (n, 3), by point.
        """
        rr = self._rr
        for name, place in sorted(places.items()):
            place = np.asarray(place, dtype=np.float32)
            number = list(self._last_place).index(name) if name in self._last_place else len(self._last_place)
            colour = _bytes(colours.of_point(number))
            if f"{POINTS}/{name}" not in self._static:
                self._static.add(f"{POINTS}/{name}")
                style = rr.Points3D.from_fields(radii=_POINT_RADIUS, colors=[colour], labels=[name])
                self._stream.log(f"{POINTS}/{name}", style, static=True)
                style = rr.LineStrips3D.from_fields(radii=_TRACE_RADIUS, colors=[colour])
                self._stream.log(f"{TRACES}/{name}", style, static=True)
            index = [rr.TimeColumn(TIMELINE, duration=times)]
            self._stream.send_columns(
                f"{POINTS}/{name}", indexes=index, columns=rr.Points3D.columns(positions=place)
            )
            before = np.concatenate([[self._last_place.get(name, place[0])], place[:-1]])
            pieces = np.stack([before, place], axis=1)
            self._stream.send_columns(
                f"{TRACES}/{name}", indexes=index, columns=rr.LineStrips3D.columns(strips=pieces)
            )
            self._last_place[name] = place[-1]

    def curves(
        self, plot: str, names: Sequence[str], times: np.ndarray, values: np.ndarray, *, dots: bool = False
    ) -> None:
        """Extend the curves of a plot.

        Args:
            plot: Title of the plot, with unit.
            names: Curves.
            times: Times [s], shape (n,).
            values: Values, shape (n, n_names).
            dots: Draw dots in place of lines.
        """
        rr = self._rr
        place = f"{PLOTS}/{self.plots.setdefault(plot, _path_of(plot))}"
        for number, name in enumerate(names):
            path = f"{place}/{name}"
            if path not in self._static:
                self._static.add(path)
                options: dict[str, Any] = {"colors": [self._colours.of(name)], "names": [name]}
                style = (
                    rr.SeriesPoints.from_fields(marker_sizes=[1.5], markers=["circle"], **options)
                    if dots
                    else rr.SeriesLines.from_fields(widths=[2.0], **options)
                )
                self._stream.log(path, style, static=True)
            self._stream.send_columns(
                path,
                indexes=[rr.TimeColumn(TIMELINE, duration=times)],
                columns=rr.Scalars.columns(scalars=np.asarray(values[:, number], dtype=float)),
            )

    def _archetype(self, kind: str, specs: list[MarkerSpec]) -> object:
        rr, painted = self._rr, [_bytes(spec.colour) for spec in specs]
        if kind == "lines":
            strips = [np.asarray(spec.points, dtype=np.float32) for spec in specs]
            return rr.LineStrips3D(strips, radii=[0.5 * spec.scale[0] for spec in specs], colors=painted)
        if kind == "arrows":
            ends = np.array([spec.points for spec in specs], dtype=np.float32).reshape(-1, 2, 3)
            radii = [spec.scale[0] for spec in specs]
            return rr.Arrows3D(
                origins=ends[:, 0], vectors=ends[:, 1] - ends[:, 0], radii=radii, colors=painted
            )
        if kind == "links":
            return rr.Capsules3D(
                lengths=[spec.scale[2] for spec in specs],
                radii=[0.5 * spec.scale[0] for spec in specs],
                # The origin of a capsule is its end, of a cylinder in ROS its middle.
                translations=np.reshape([_foot(spec) for spec in specs], (-1, 3)),
                quaternions=np.reshape([spec.orientation for spec in specs], (-1, 4)),
                colors=painted,
                fill_mode="solid",
            )
        if kind == "balls":
            groups = [np.asarray(f.points if len(f.points) else [f.position]).reshape(-1, 3) for f in specs]
            sizes = [len(group) for group in groups]
            return rr.Points3D(
                np.concatenate([np.zeros((0, 3)), *groups]),
                radii=np.repeat([0.5 * spec.scale[0] for spec in specs], sizes),
                colors=np.repeat(np.array(painted, dtype=np.uint8).reshape(-1, 4), sizes, axis=0),
            )
        places = np.reshape([spec.position for spec in specs], (-1, 3))
        return rr.Points3D(places, radii=1e-4, colors=painted, labels=[spec.text for spec in specs])


_KINDS = {
    LINE_STRIP: "lines",
    CYLINDER: "links",
    SPHERE: "balls",
    SPHERE_LIST: "balls",
    ARROW: "arrows",
    TEXT: "labels",
}


def _bytes(colour: Iterable[float]) -> tuple[int, ...]:
    return tuple(round(255.0 * channel) for channel in colour)


def _foot(cylinder: MarkerSpec) -> np.ndarray:
    """Return the end of a cylinder's axis [m], shape (3,)."""
    along = rotate(np.array(cylinder.orientation), (0.0, 0.0, 1.0))
    return np.asarray(cylinder.position) - 0.5 * cylinder.scale[2] * along


def _path_of(title: str) -> str:
    """Return a title as part of a path: words joined, without the part after ':' or '['."""
    return "_".join(re.split(r"[:\[]", title)[0].split())


class CurveColours:
    """Colours of curves: an axis has its own, an arm one in the order of first sight.

    Joints have a colour each; it is paler with each further arm, and starts again after four arms.
    """

    def __init__(self) -> None:
        self._arms: dict[str, int] = {}

    def of(self, name: str) -> tuple[int, ...]:
        """Return the colour of `z`, of an arm or of `<arm>_joint_<k>`, 0 to 255 each."""
        if name in AXIS_COLOURS:
            return _bytes(to_rgb(AXIS_COLOURS[name]))
        arm, _, joint = name.partition("_joint_")
        number = self._arms.setdefault(arm, len(self._arms))
        if not joint.isdecimal():
            return _bytes(to_rgb(LINE_COLOURS[number % len(LINE_COLOURS)]))
        colour = np.array(to_rgb(LINE_COLOURS[(int(joint) - 1) % len(LINE_COLOURS)]))
        return _bytes(1.0 - 0.6 ** (number % 4) * (1.0 - colour))
