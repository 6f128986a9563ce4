"""Writes ldcs_ros/validate/finite_elements.py: finite-element answers that `ldcs validate --mechanics` compares with.

Plane stress with biquadratic quadrilaterals and Kirchhoff plates with Morley triangles, by scikit-fem
(requirements/finite_elements.lock). Each number is extrapolated from two meshes; the change is printed.

    .venv/bin/python -m pip install --no-deps --require-hashes -r requirements/finite_elements.lock
    .venv/bin/python tools/make_finite_elements.py
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import eigsh
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad2,
    ElementTriMorley,
    ElementVector,
    LinearForm,
    MeshQuad,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import dd, ddot, grad, sym_grad, trace

from ldcs_ros.validate import problems as p

TARGET = Path(__file__).parent.parent / "ldcs_ros" / "validate" / "finite_elements.py"


def plane_stress(mesh: MeshQuad, factor: Callable, shear: float, pull: str, symmetric: tuple[str, ...]):
    """Return basis and displacement for a unit modulus times `factor(x, y)` and a unit stress along x at `pull`."""
    basis = Basis(mesh, ElementVector(ElementQuad2()))

    @BilinearForm
    def energy(u, v, w):
        e, d = sym_grad(u), sym_grad(v)
        c11 = factor(w.x[0], w.x[1]) / (1.0 - p.POISSON**2)
        c12, c66 = p.POISSON * c11, shear * 0.5 * (1.0 - p.POISSON) * c11
        normal = (c11 * e[0, 0] + c12 * e[1, 1]) * d[0, 0] + (c12 * e[0, 0] + c11 * e[1, 1]) * d[1, 1]
        return normal + 4.0 * c66 * e[0, 1] * d[0, 1]

    @LinearForm
    def load(v, w):
        return v[0]

    edge = basis.boundary(pull)
    held = np.concatenate([basis.get_dofs(name).all(f"u^{1 + (name == 'y')}") for name in symmetric])
    return basis, solve(*condense(energy.assemble(basis), load.assemble(edge), D=held))


def quarter_with_hole(n: int) -> MeshQuad:
    """Return a quarter of the strip with a hole, its middle at the origin; boundaries x, y (of symmetry) and end."""
    half_x, half_y, r = 0.5 * p.LENGTH, 0.5 * p.HOLED_WIDTH, p.HOLE_RADIUS
    mesh = MeshQuad.init_tensor(np.linspace(0.0, 1.0, 2 * n + 1), np.linspace(0.0, 1.0, 2 * n + 1))
    s, t = mesh.p[0], mesh.p[1] ** 1.5
    angle = 0.5 * math.pi * s
    first = np.minimum(2.0 * s, 1.0)
    second = np.maximum(2.0 * s - 1.0, 0.0)
    outer = np.stack([half_x * (1.0 - second), half_y * first])
    inner = r * np.stack([np.cos(angle), np.sin(angle)])
    place = (1.0 - t) * inner + t * outer
    return MeshQuad(place, mesh.t).with_boundaries(
        {
            "x": lambda x: np.abs(x[0]) < 1e-9,
            "y": lambda x: np.abs(x[1]) < 1e-9,
            "end": lambda x: np.abs(x[0] - half_x) < 1e-9,
        }
    )


def holed(shear: float) -> Callable[[int], np.ndarray]:
    """Strain at the hole's side, beside it over its diameter, and its elongation over it, for a unit gross strain."""

    def answer(n: int) -> np.ndarray:
        basis, u = plane_stress(quarter_with_hole(n), lambda x, y: 1.0 + 0.0 * x, shear, "end", ("x", "y"))
        h = 1e-3 * p.HOLE_RADIUS
        near = basis.probes(np.array([[h, 2 * h], [p.HOLE_RADIUS * (1.0 + 2e-6)] * 2])) @ u
        strain = (4.0 * near[0] - near[1]) / (2.0 * h)
        nose = basis.probes(np.array([[p.HOLE_RADIUS * (1.0 + 1e-9)], [1e-9]])) @ u
        corner = basis.probes(np.array([[p.HOLE_RADIUS], [p.HOLE_RADIUS]])) @ u
        return np.array([strain, corner[0] / p.HOLE_RADIUS, nose[0] / p.HOLE_RADIUS])

    return answer


def inclusion(shear: float) -> Callable[[int], np.ndarray]:
    """Mean extension of a stretched square with a stiff square inside, over its length, for a unit strain."""

    def answer(n: int) -> np.ndarray:
        half = 0.5 * p.SIDE
        mesh = MeshQuad.init_tensor(np.linspace(0.0, half, 4 * n + 1), np.linspace(0.0, half, 4 * n + 1))
        mesh = mesh.with_boundaries(
            {
                "x": lambda x: x[0] < 1e-9,
                "y": lambda x: x[1] < 1e-9,
                "end": lambda x: np.abs(x[0] - half) < 1e-9,
            }
        )
        inside = 0.5 * p.INCLUSION_SIDE

        def factor(x, y):
            return np.where((x < inside) & (y < inside), p.INCLUSION_FACTOR, 1.0)

        basis, u = plane_stress(mesh, factor, shear, "end", ("x", "y"))
        end = basis.boundary("end")

        @LinearForm
        def mean(v, w):
            return v[0] / half

        return np.array([(mean.assemble(end) @ u) / half])

    return answer


def sag(thickness: Callable, half_width: Callable) -> Callable[[int], np.ndarray]:
    """Sag of the tip of a cantilever plate under its own weight, times E / (density g), for its thicknesses."""

    def answer(n: int) -> np.ndarray:
        mesh = MeshTri.init_tensor(np.linspace(0.0, p.LENGTH, 8 * n + 1), np.linspace(-1.0, 1.0, 2 * n + 1))
        place = np.stack([mesh.p[0], mesh.p[1] * half_width(mesh.p[0])])
        mesh = MeshTri(place, mesh.t).with_boundaries({"clamp": lambda x: x[0] < 1e-9})
        basis = Basis(mesh, ElementTriMorley(), intorder=4)

        @BilinearForm
        def energy(u, v, w):
            rigidity = thickness(w.x[0]) ** 3 / (12.0 * (1.0 - p.POISSON**2))
            both = (1.0 - p.POISSON) * ddot(dd(u), dd(v)) + p.POISSON * trace(dd(u)) * trace(dd(v))
            return rigidity * both

        @LinearForm
        def weight(v, w):
            return -thickness(w.x[0]) * v

        u = solve(*condense(energy.assemble(basis), weight.assemble(basis), D=basis.get_dofs("clamp")))
        tip = np.argmin(np.hypot(mesh.p[0] - p.LENGTH, mesh.p[1]))
        return np.array([u[basis.nodal_dofs[0, tip]]])

    return answer


def plate_eigenvalues(n: int) -> np.ndarray:
    """Lowest three frequencies [1/s] times sqrt(density / E), and the load in its plane that buckles it over E."""
    mesh = MeshTri.init_tensor(
        np.linspace(0.0, p.LENGTH, 4 * n + 1), np.linspace(-0.5 * p.WIDTH, 0.5 * p.WIDTH, n + 1)
    ).with_boundaries({"clamp": lambda x: x[0] < 1e-9})
    basis = Basis(mesh, ElementTriMorley(), intorder=4)
    rigidity = p.THICKNESS**3 / (12.0 * (1.0 - p.POISSON**2))

    @BilinearForm
    def energy(u, v, w):
        both = (1.0 - p.POISSON) * ddot(dd(u), dd(v)) + p.POISSON * trace(dd(u)) * trace(dd(v))
        return rigidity * both

    @BilinearForm
    def mass(u, v, w):
        return p.THICKNESS * u * v

    @BilinearForm
    def prestress(u, v, w):
        # A unit force along y at the tip: bending and shear of the beam in its plane, forces per width.
        x, y = w.x[0], w.x[1]
        n_xx = -12.0 * (p.LENGTH - x) * y / p.WIDTH**3
        n_xy = 1.5 / p.WIDTH * (1.0 - 4.0 * y**2 / p.WIDTH**2)
        du, dv = grad(u), grad(v)
        return n_xx * du[0] * dv[0] + n_xy * (du[0] * dv[1] + du[1] * dv[0])

    free = basis.complement_dofs(basis.get_dofs("clamp"))
    k, m, g = (form.assemble(basis)[free][:, free].tocsc() for form in (energy, mass, prestress))
    squares = np.sort(eigsh(k, 3, m, sigma=0.0)[0])
    inverse = eigsh(g, 1, k, which="LA", return_eigenvectors=False)[0]
    return np.array([*np.sqrt(squares) / (2.0 * math.pi), 1.0 / inverse])


def extrapolated(answer: Callable[[int], np.ndarray], n: int) -> tuple[float, ...]:
    """Return the limit of errors that fall by four when the mesh is halved."""
    coarse, fine = answer(n), answer(2 * n)
    limit = fine + (fine - coarse) / 3.0
    print(answer.__qualname__.split(".")[0], limit, "last change", fine / coarse - 1.0, flush=True)
    return tuple(float(f"{value:.6g}") for value in limit)


def main() -> None:
    """Compute and write."""

    def uniform(x):
        return np.full_like(x, p.THICKNESS)

    def straight(x):
        return np.full_like(x, 0.5 * p.WIDTH)

    lattice_shear = p.SHEAR_FACTOR
    found = {
        "HOLED": extrapolated(holed(1.0), 24),
        "HOLED_OF_LATTICE_SHEAR": extrapolated(holed(lattice_shear), 24),
        "INCLUSION": extrapolated(inclusion(1.0), 12),
        "INCLUSION_OF_LATTICE_SHEAR": extrapolated(inclusion(lattice_shear), 12),
        "STRIP_SAG": extrapolated(sag(uniform, straight), 16),
        "TAPERED_THICKNESS_SAG": extrapolated(sag(p.stepped_thickness, straight), 16),
        "TAPERED_WIDTH_SAG": extrapolated(sag(uniform, p.tapered_half_width), 16),
    }
    eigenvalues = extrapolated(plate_eigenvalues, 12)
    found |= {"STRIP_FREQUENCIES": eigenvalues[:3], "LATERAL_LOAD": eigenvalues[3:]}
    words = {
        "STRIP_FREQUENCIES": "Cantilever plate: frequencies of bending (two), torsion times sqrt(density / E) [1/m].",
        "LATERAL_LOAD": "Cantilever plate: force in its plane at the tip that buckles it, over E [m^2].",
        "HOLED": "Strip with a hole, a gross strain: strain at its side, beside it over its diameter, its elongation.",
        "HOLED_OF_LATTICE_SHEAR": "The same with the shear stiffness of the lattice.",
        "INCLUSION": "Stretched square with a stiff square inside: extension over its length, a strain.",
        "INCLUSION_OF_LATTICE_SHEAR": "The same with the shear stiffness of the lattice.",
        "STRIP_SAG": "Cantilever plate: sag under its weight, times E / (density g) [m^2 / m].",
        "TAPERED_THICKNESS_SAG": "The same with a thickness that falls in steps.",
        "TAPERED_WIDTH_SAG": "The same with a width that falls.",
    }
    lines = [
        '"""Finite-element answers, written by tools/make_finite_elements.py; do not edit."""',
        "",
        "from __future__ import annotations",
        "",
    ]
    for name, values in found.items():
        lines += [f"{name} = {values[0] if len(values) == 1 else values!r}", f'"""{words[name]}"""']
    TARGET.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
