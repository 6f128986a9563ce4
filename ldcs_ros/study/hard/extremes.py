"""Hard cases at the ends of the schema: no damping for a minute, k = 1e9 N/m, massless links, coils, 64 links."""

from __future__ import annotations

from ldcs_ros.study.hard.case import HardCase, repetition
from ldcs_ros.study.hard.scenes import Content

POINTS: Content = {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]}
CLAMP: Content = {"type": "clamp"}


def sheet(
    nodes: list[int],
    *effects: Content,
    size: tuple[float, float, float] = (0.14, 0.14, 0.01),
    inputs: list[Content] | None = None,
    accuracy: float = 1e-5,
) -> Content:
    """Return a scene of a sheet of 0.1 kg with effects, commands and an accuracy [m]."""
    return {
        "lattice": {"size": list(size), "nodes": nodes, "mass": 0.1},
        "points": POINTS,
        "effects": list(effects),
        "inputs": inputs or [],
        "solver": {"accuracy": accuracy},
    }


def springs(stiffness: float, damping: float, law: str = "axial") -> Content:
    """Return springs."""
    return {"type": "springs", "law": law, "stiffness": stiffness, "damping": damping}


def gravity(z: float = -9.81, x: float = 0.0, y: float = 0.0) -> Content:
    """Return gravity by its components [m/s^2]."""
    return {"type": "gravity", "acceleration": [x, y, z]}


def arms(**own: object) -> Content:
    """Return two arms of moderate stiffness with own parameters."""
    usual = {"links": 3, "coupling_stiffness": 2000.0, "coupling_damping": 50.0, "joint_stiffness": 0.2}
    return {"type": "arms", "drive": "torque", **usual, **own}


ROUGH = 1e-4  # m
TORQUE: list[Content] = [{"time": 0.0, "torque": 0.03}, {"time": 0.2, "torque": -0.02}]
PRESSURE: list[Content] = [{"time": 0.0, "pressure": 40e3}, {"time": 0.2, "pressure": 0.0}]
# A spring constant at which springs of nodes of a few grams swing some ten times a second.
SOFT = 5.0

PHASE = "an error of the phase of a swing lasts the whole minute and adds up; the estimate counts it"

UNDAMPED = tuple(
    HardCase(
        f"{how} for {duration:g} s, {law}, {nodes[0]} x {nodes[1]} nodes",
        sheet(nodes, springs(SOFT, damping, law), gravity(-0.5), CLAMP, accuracy=ROUGH),
        duration,
        PHASE,
    )
    for how, damping in (("no damping", 0.0), ("damping 1e-4 N s/m", 1e-4))
    for nodes, law, duration in (
        ([2, 2], "axiswise", 60.0),
        ([2, 2], "axial", 60.0),
    )
)

STIFF = (
    HardCase(
        "k = 1e9 N/m, damped",
        sheet([4, 3], springs(1e9, 1e4), gravity(), CLAMP),
        0.3,
    ),
    HardCase("k = 1e9 N/m, undamped", sheet([3, 2], springs(1e9, 0.0), gravity(), CLAMP), 0.01),
    HardCase(
        "k = 1e9 N/m with arms",
        sheet([4, 3], springs(1e9, 1e5), CLAMP, arms(), inputs=TORQUE),
        0.4,
    ),
    HardCase(
        "couplings of 1e9 N/m",
        sheet(
            [4, 3],
            springs(300.0, 1.0),
            CLAMP,
            arms(coupling_stiffness=1e9, coupling_damping=1e4),
            inputs=TORQUE,
        ),
        0.4,
    ),
    HardCase(
        "k = 1e-3 N/m in a fluid",
        sheet(
            [4, 3],
            springs(1e-3, 1e-4),
            gravity(-1.0),
            CLAMP,
            {"type": "drag", "density": 1000.0, "coefficient": 1.2},
            accuracy=ROUGH,
        ),
        1.0,
    ),
)

MASSLESS = tuple(
    HardCase(
        f"links of 1e-9 kg without inertia, {words}",
        sheet(
            [4, 3],
            springs(300.0, 1.0),
            gravity(),
            CLAMP,
            arms(link_mass=1e-9, link_inertia=0.0, **own),
            inputs=PRESSURE if own.get("drive") == "pressure" else TORQUE,
        ),
        0.4,
    )
    for words, own in (
        ("torque", {}),
        ("joints without damping", {"joint_damping": 0.0}),
        ("couplings without damping", {"coupling_damping": 0.0}),
        ("pressure", {"drive": "pressure", "pressure_gain": 5e-7}),
    )
)

TURNS = (
    "the edge winds 22 times at up to 420 rad/s; the error falls with the accuracy, 2e-4, 8e-6 m at 1e-5, 1e-6 m, and "
    "the estimate counts it"
)
COILED = (
    *(
        HardCase(
            f"edges wound to {kappa:g} 1/m",
            sheet(
                [5, 3], springs(300.0, 1.0), {"type": "driven_edges", "curvature": kappa, "rise_time": 0.5}
            ),
            0.8,
            TURNS if abs(kappa) > 100.0 else "",
        )
        for kappa in (-1000.0, 100.0)
    ),
    HardCase(
        "arms wound to 1000 1/m",
        sheet([4, 3], springs(300.0, 1.0), CLAMP, arms(drive="curvature", curvature=1000.0, rise_time=0.5)),
        0.6,
    ),
)

LINKS = tuple(
    HardCase(
        f"64 links, {drive}",
        sheet(
            [5, 3],
            springs(300.0, 1.0),
            gravity(),
            CLAMP,
            arms(
                links=64,
                drive=drive,
                link_mass=3e-4,
                link_inertia=1e-9,
                **({"curvature": 6.0, "rise_time": 0.2} if drive == "curvature" else {"pressure_gain": 5e-7}),
            ),
            inputs={"pressure": PRESSURE, "torque": TORQUE}.get(drive),
        ),
        0.3,
    )
    for drive in ("torque", "pressure", "curvature")
)

PERIOD = 0.1  # s
CYCLES = HardCase(
    "10000 load cycles",
    sheet(
        [2, 2],
        springs(300.0, 3.0),
        gravity(),
        CLAMP,
        arms(links=1),
        inputs=[{"time": 0.5 * PERIOD * k, "torque": 0.03 * (1 - k % 2)} for k in range(20_000)],
    ),
    10_000 * PERIOD,
    check=repetition,
    sample_from=40 * PERIOD,
    period=10 * PERIOD,
    memory=4e6,
    reason="every tenth of the cycles is compared with their mean",
)

EXTREME_CASES = (*UNDAMPED, *STIFF, *MASSLESS, *COILED, *LINKS, CYCLES)
