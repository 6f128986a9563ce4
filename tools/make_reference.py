"""Write docs/reference.md from the tables of the code: `make docs`."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ldcs_ros.cli.effects import bounds_text, describe, describe_class, value_text
from ldcs_ros.integrators import INTEGRATORS, integrator_class
from ldcs_ros.messages.topics import TOPICS, Topic
from ldcs_ros.mock_rig.topics import ARRAY, COMMAND, FLUID, SETPOINT, TRACKER, TRANSFORM
from ldcs_ros.physics.effects import EFFECTS
from ldcs_ros.physics.material import Material
from ldcs_ros.rig.topics import bridge_topics
from ldcs_ros.ros.common.parameters import NodeParameter
from ldcs_ros.ros.common.service_table import BRIDGE_SERVICES, SIM_SERVICES, ServiceEntry
from ldcs_ros.ros.rig.rig_parameters import BRIDGE_PARAMETERS, MOCK_RIG_PARAMETERS
from ldcs_ros.ros.sim.parameters import PARAMETERS
from ldcs_ros.scene.schema import REPEATABLE, SENSORS, TOP_KEYS

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/reference.md"

HEAD = """\
# Reference

Topics, services, parameters, messages, scene keys, effects and integrators, as the code has them. `make
docs` writes this page; a test fails when it is stale. All numbers are SI. Names without a leading `/` are
relative to the node's namespace, `~/` to the node. Every node also has the parameter services of ROS and
takes `qos_overrides` where noted.

[sim](#sim) | [bridge](#bridge) | [mock_rig](#mock_rig) | [messages](#messages) | [scene keys](#scene-keys)
| [effects](#effects) | [integrators](#integrators)
"""

SIM = """\
## sim

Node `/ldcs/ldcs_sim`, a lifecycle node with the standard services (`~/change_state`, `~/get_state`, ...);
`autostart` configures and activates it. Services of `ldcs_msgs` and of ros-simulation's `simulation_interfaces`
are offered where these packages are installed. `{point}` is a placeholder for each named point of the scene,
`{arm}` for each arm. Reliability, durability, history and depth of each topic can be overridden:
`qos_overrides./ldcs/nodes.publisher.reliability: best_effort`.
"""

BRIDGE = """\
## bridge

Node `/ldcs/ldcs_bridge`: a rig with the twin beside it. It publishes the topics of `sim` as well, for its
twin, and listens to the rig's own topics as the [rig file](bridge.md#the-rig-file) says. `estimate/...`
come in mode `mirror` only.
"""

MOCK_RIG = """\
## mock_rig

Node `/mock_rig`: a mock rig. With the transports `modbus` and `serial` only the tracker stays on a
topic.
"""

# The keys of a scene file in words.
SCENE_KEYS = {
    "title": "one line for people",
    "lattice": "`size: [x, y, z]` m; `nodes: [nx, ny]`, 2 and more along x and y, always two layers; `mass` kg, "
    "unless there is a `material`",
    "material": "material of the sheet, instead of mass, stiffness and damping",
    "points": "names of places: `[layer, i, j]`, layer `bottom`, `top` or `mid`; or `[layer, centre]`, "
    "`[layer, free_edge]` at any number of nodes",
    "effects": "list of effects, each with its `type`; only these are built",
    "inputs": "schedule of commands without a sender, in order of time: list of `{time: s}` with `torque` N m (a "
    "number, one for each arm, or one for each joint), `pressure` Pa (a number, or one for each arm), or "
    "`wrench: {frame, force: N, torque: N m}`",
    "sensors": "measurements; a scene without them computes none",
    "solver": "`{integrator: auto, accuracy: m, verify: false, commands: auto}`, 1e-10 ... 1e-2; or "
    "`{integrator: NAME, dt: s}` for a fixed step",
}


def page() -> str:
    """Return the whole page."""
    mock = {TRACKER: TRANSFORM, SETPOINT: ARRAY, "/rig/{arm}/pressure": FLUID}
    mock_topics = [
        Topic(
            COMMAND, ARRAY, "in", "set-points [Pa], left, right, for the controller `remote`", recorded=False
        ),
        *(
            Topic(name, kind, "out", _MOCK_MEANINGS[name], depth=50, recorded=False)
            for name, kind in mock.items()
        ),
        Topic("~/chambers", ARRAY, "out", _MOCK_MEANINGS["~/chambers"], recorded=False),
    ]
    command = Topic(
        "pressure_command", ARRAY, "in", "mode live: gauge pressures [Pa], left, right, for the rig"
    )
    added = bridge_topics(["{point}"], ["{arm}"], estimate=True)
    parts = [HEAD, SIM, _topics(TOPICS.values()), _services(SIM_SERVICES), _parameters(PARAMETERS.values())]
    parts += [BRIDGE, _topics([command, *added.values()]), _services(BRIDGE_SERVICES)]
    parts += [_parameters(BRIDGE_PARAMETERS.values())]
    parts += [MOCK_RIG, _topics(mock_topics), _parameters(MOCK_RIG_PARAMETERS.values())]
    parts += [_messages(), _scene(), _effects(), _integrators()]
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


_MOCK_MEANINGS = {
    TRACKER: "the rig's tracker, one message a probe, on the rig's own clock",
    SETPOINT: "set-points of its valves, gauge [mbar], left, right",
    "/rig/{arm}/pressure": "measured pressure [Pa], absolute",
    "~/chambers": "true gauge pressures [Pa] left, right, the largest so far, smallest and largest set-point asked for",
}


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    def cell(text: str) -> str:
        return text.replace("|", r"\|").replace("<", "&lt;")

    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(map(cell, line))} |" for line in lines) + "\n"


def _topics(topics: Iterable[Topic]) -> str:
    head = ("direction", "topic", "type", "quality of service", "in bags", "what it carries")
    rows = [
        (
            topic.direction,
            f"`{topic.name}`",
            f"`{topic.type}`",
            ", ".join(
                [
                    "reliable" if topic.reliable else "best effort",
                    *(["transient local"] if topic.transient_local else []),
                    f"depth {topic.depth}",
                ]
            ),
            "yes" if topic.recorded else "",
            topic.meaning + ("; built only while it has subscribers" if topic.on_demand else ""),
        )
        for topic in topics
    ]
    return _table(head, rows)


def _services(services: Iterable[ServiceEntry]) -> str:
    rows = [(f"`{one.name}`", f"`{one.type}`", one.meaning) for one in services]
    return _table(("service", "type", "what it does"), rows)


def _parameters(parameters: Iterable[NodeParameter]) -> str:
    rows = []
    for one in parameters:
        change = (
            "while unconfigured" if one.at_configure else "no, read-only" if one.read_only else "at any time"
        )
        rows.append(
            (
                f"`{one.name}`",
                {str: "string", float: "double", int: "integer", bool: "bool"}[type(one.default)],
                f"`{_yaml(one.default)}`",
                one.accepted,
                change,
                one.description,
            )
        )
    return _table(("parameter", "type", "default", "range", "may change", "meaning"), rows)


def _short(number: float) -> str:
    return str(number) if isinstance(number, int) else f"{number:g}"


def _yaml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else '""' if value == "" else str(value)


def _messages() -> str:
    parts = ["## messages\n\nThe interface package `ldcs_msgs` (`msg_defs/`). The nodes run without it.\n"]
    for path in sorted((ROOT / "msg_defs").glob("*/*.[ms][sr][gv]")):
        text = path.read_text(encoding="utf-8").strip()
        parts.append(f"### ldcs_msgs/{path.parent.name}/{path.stem}\n\n```\n{text}\n```\n")
    return "\n".join(parts)


def _scene() -> str:
    assert tuple(SCENE_KEYS) == TOP_KEYS, f"describe each key of a scene: {TOP_KEYS}"
    keys = _table(("key", "meaning"), [(f"`{key}`", text) for key, text in SCENE_KEYS.items()])
    sensors = [
        (f"`{sensor}`", f"`{p['name']}`", value_text(p), f"{_short(p['low'])} ... {_short(p['high'])}")
        for sensor, cls in SENSORS.items()
        for p in describe_class(cls)["parameters"]
        if p["name"] != "points"
    ]
    material = describe_class(Material)
    return "\n".join(
        [
            "## scene keys\n",
            "An unknown key, a missing one, a wrong type or a number out of its bounds is refused with its path.\n"
            "`ldcs scenes --show paper` prints one to start from.\n",
            keys,
            "`material`:\n",
            _quantities(material["parameters"]),
            "`sensors`; the tracker also has `points`, the names of those that carry a probe:\n",
            _table(("sensor", "key", "default", "range"), sensors),
        ]
    )


def _effects() -> str:
    several = ", ".join(f"`{name}`" for name in REPEATABLE)
    parts = [
        f"## effects\n\n`ldcs effects NAME` prints the same. A scene may name {several} more than once.\n"
    ]
    for name in EFFECTS:
        effect = describe(name)
        text = effect["description"].replace("*", r"\*")
        parts.append(f"### {name}\n\n{text}\n")
        parts.append(_quantities(effect["parameters"]))
    return "\n".join(parts)


def _quantities(parameters: Iterable[dict[str, Any]]) -> str:
    rows = [
        (f"`{one['name']}`", value_text(one), bounds_text(one), one["help"], one["origin"])
        for one in parameters
    ]
    return _table(("key", "default", "range", "meaning", "origin"), rows)


def _integrators() -> str:
    rows = []
    for name in INTEGRATORS:
        method = integrator_class(name)
        module = inspect.getmodule(method)
        summary = (inspect.getdoc(module) or "").splitlines()[0]
        rows.append((f"`{name}`", str(method.order), summary))
    return f"## integrators\n\n{_table(('name', 'order', 'what it is'), rows)}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
