"""The accuracy study: equations that share no code with the product, a reference, and figures of real errors."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.study.accuracy import reference as references
from ldcs_ros.study.accuracy.equations import Equations
from ldcs_ros.study.accuracy.measure import Pair, pairs
from ldcs_ros.study.accuracy.random_scenes import Case, random_case
from ldcs_ros.study.accuracy.reference import reference
from ldcs_ros.study.accuracy.report import draw, figures, page, read_pairs, write_pairs
from ldcs_ros.study.accuracy.shipped_cases import shipped_cases
from ldcs_ros.study.accuracy.violent_cases import violent_cases


def _scenes():
    drawn = [(f"random {seed}", random_case(seed).content) for seed in range(12)]
    return [*drawn, *((name, load_scene(name).content) for name in shipped_scenes())]


@pytest.mark.parametrize(
    ("name", "content"), _scenes(), ids=lambda value: value if isinstance(value, str) else ""
)
def test_the_independent_equations_give_the_accelerations_of_the_model(name, content):
    scene = load_scene(content)
    simulation = scene.build()
    model, equations = simulation.model, Equations(scene)
    np.testing.assert_array_equal(equations.free, model.free)
    rng = np.random.default_rng(int(name.partition(" ")[2] or 0))
    q, u = model.reference_state()
    q[model.free] += (0.003 if name.startswith("random") else 5e-4) * rng.normal(size=len(model.free))
    u[model.free] += 0.1 * rng.normal(size=len(model.free))
    time = 7e-4
    model.prescribe(time, q, u)
    own_q, own_u = q.copy(), u.copy()
    equations.prescribe(time, own_q, own_u)
    np.testing.assert_allclose(own_q, q, atol=1e-13)
    np.testing.assert_allclose(own_u, u, atol=1e-11)
    equations.held = simulation.inputs.torque
    if simulation.inputs.pressure is not None:
        equations.pressure = simulation.inputs.chamber_pressure
    for command in scene.inputs:
        if command.wrench is not None and command.time == 0.0:
            equations.wrenches[command.wrench[0]] = np.array(command.wrench[1]), np.array(command.wrench[2])
    expected = model.accelerate(time, q, u, simulation.inputs.held())
    own = equations.accelerations(time, q, u)[model.free]
    assert np.abs(own - expected).max() <= 1e-10 * np.abs(expected).max()


def test_every_case_is_a_scene_and_random_scenes_cover_the_laws_and_effects():
    drawn = [random_case(seed) for seed in range(120)]
    assert drawn[7] == random_case(7)
    assert all(load_scene(case.content).build().model.free.size for case in [*drawn, *violent_cases()])
    effects = [effect for case in drawn for effect in case.content["effects"]]
    assert {effect["law"] for effect in effects if effect["type"] == "springs"} == {
        "axial",
        "axiswise",
        "corotational",
    }
    assert {effect["drive"] for effect in effects if effect["type"] == "arms"} == {
        "torque",
        "pressure",
        "curvature",
    }
    assert {"clamp", "driven_edges", "floor", "support", "drag", "payload", "force", "wrench"} <= {
        effect["type"] for effect in effects
    }


def test_a_smooth_fall_is_within_the_asked_accuracy_of_the_reference_and_the_study_says_so(tmp_path):
    content = {
        "lattice": {"size": [0.1, 0.1, 0.01], "nodes": [2, 2], "mass": 0.05},
        "effects": [
            {"type": "springs", "stiffness": 200.0, "damping": 1.0},
            {"type": "gravity"},
            {"type": "clamp", "edge": "x_min"},
        ],
    }
    case = Case("clamped_cell", content, 0.2, looks=10)
    found = list(pairs(case, (1e-3, 1e-5), cache=tmp_path, seconds=30.0))
    assert [(pair.asked, pair.reference) for pair in found] == [(1e-3, "SciPy"), (1e-5, "SciPy")]
    for pair in found:
        assert 1e-12 < pair.real <= pair.asked
        assert 0.0 < pair.velocity <= min(pair.velocity_promise, 1.5 * pair.velocity_estimate)
    assert list(tmp_path.glob("*.npz"))
    finer = list(pairs(case, (1e-3, 1e-5), cache=tmp_path / "none", seconds=0.0))
    assert [pair.reference for pair in finer] == ["finer run"] * 2
    assert [pair.real for pair in finer] == pytest.approx([pair.real for pair in found], rel=0.1)
    assert finer[1].velocity == pytest.approx(found[1].velocity, rel=0.1)
    write_pairs(found, tmp_path)
    assert read_pairs(tmp_path)[1].real == pytest.approx(found[1].real, rel=1e-3)
    assert "| asked 0.001 m | 1 | 100% |" in page(found, "command")
    draw(found, tmp_path / "accuracy.png")
    assert (tmp_path / "accuracy.png").stat().st_size > 1000


def test_the_figures_count_missed_accuracies_and_silent_estimates():
    def pair(real, estimate, failure=""):
        return Pair("case", 1e-5, real, estimate, 1, 0.1, failure)

    found = figures(
        [pair(1e-6, 2e-6), pair(4e-5, 1e-5), pair(5e-6, 4e-6), pair(1e-7, 1e-5), pair(0.0, 0.0, "stopped")]
    )
    assert (found.pairs, found.stopped, found.within) == (4, 1, 0.75)
    assert found.ratio[2] == pytest.approx(4.0)
    assert (found.consistent, found.sharp) == (0.75, 0.75)


def test_a_reference_begins_in_the_shape_of_its_case(tmp_path):
    content = {
        "lattice": {"size": [0.1, 0.1, 0.01], "nodes": [2, 2], "mass": 0.1},
        "effects": [{"type": "springs", "law": "axial", "stiffness": 50.0, "damping": 1.0}],
    }
    rest = load_scene(content).lattice.reference_position
    start = rest + 0.002 * np.random.default_rng(3).normal(size=rest.shape)
    case = Case(
        "shaped", content, 1e-3, drift=(0.1, 0.0, 0.0), looks=1, start=tuple(map(tuple, start.tolist()))
    )
    simulation = load_scene(content).with_accuracy(1e-7).build()
    simulation.start_from(start, np.tile([0.1, 0.0, 0.0], (len(start), 1)))
    simulation.advance_to(1e-3)
    known = reference(case, cache=tmp_path)[-1]
    np.testing.assert_allclose(known, simulation.state.position, rtol=0.0, atol=2e-7)


def test_a_sparse_jacobian_gives_the_reference_of_the_full_one(tmp_path, monkeypatch):
    arms = {"type": "arms", "drive": "torque", "links": 2, "coupling_damping": 50.0}
    content = {
        "lattice": {"size": [0.1, 0.1, 0.01], "nodes": [3, 2], "mass": 0.05},
        "effects": [{"type": "springs", "damping": 0.5}, {"type": "clamp"}, {"type": "gravity"}, arms],
        "inputs": [{"time": 0.0, "torque": 0.02}],
    }
    case = Case("strip", content, 0.01, looks=4)
    full = reference(case, cache=tmp_path / "full", seconds=60.0)
    monkeypatch.setattr(references, "SPARSE_SIZE", 0)
    sparse = reference(case, cache=tmp_path / "sparse", seconds=60.0)
    np.testing.assert_allclose(sparse, full, atol=1e-10)


def test_every_shipped_scene_is_a_case():
    assert len(shipped_cases()) == len(shipped_scenes())
