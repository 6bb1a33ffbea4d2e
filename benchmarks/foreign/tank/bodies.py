"""Rebuild the tables of hydrodynamic coefficients, bodies/*.npz, with Capytaine (linear potential flow, panel method).

    python bodies.py OUT [NAME ...]

Needs capytaine; what `make.py` reads is only the tables. Every body has unit size, rho 1000, g 9.81, deep water, and is
solved on a fine and on a coarse mesh (the coarse one serves as somebody else's nominal model). Rotations are about the
centre of gravity. Tables use e^{+i w t}: Capytaine's exciting force (e^{-i w t}) is conjugated.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

G, RHO = 9.81, 1000.0
PLANAR, BEAM = ["Surge", "Heave", "Pitch"], ["Sway", "Heave", "Roll"]


def quads(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of a structured grid (p, q, 3) of points."""
    p, q = points.shape[:2]
    at = np.arange(p * q).reshape(p, q)
    faces = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    return points.reshape(-1, 3), faces


def voxels(solid, size, cells) -> tuple[np.ndarray, np.ndarray]:
    """Return the wetted surface of a union of boxes: `solid(x, y, z)` tells which cells of a box `size` are body."""
    edges = [np.linspace(-size[0] / 2, size[0] / 2, cells[0] + 1), np.linspace(-size[1] / 2, size[1] / 2, cells[1] + 1),
             np.linspace(-size[2], 0.0, cells[2] + 1)]
    mids = [(e[1:] + e[:-1]) / 2 for e in edges]
    full = np.pad(solid(*np.meshgrid(*mids, indexing="ij")), 1)
    full[:, :, -1] = full[:, :, -2]  # no face on the waterplane
    points, faces = [], []
    for i, j, k in np.argwhere(full[1:-1, 1:-1, 1:-1]):
        for axis in range(3):
            for side in (0, 1):
                near = [i + 1, j + 1, k + 1]
                near[axis] += 2 * side - 1
                if full[tuple(near)]:
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                corners = []
                for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0)):
                    at = [i, j, k]
                    at[axis] += side
                    at[u] += a
                    at[v] += b
                    corners.append([edges[c][at[c]] for c in range(3)])
                faces.append(list(range(len(points), len(points) + 4)))
                points.extend(corners)
    return np.array(points), np.array(faces)


def hull(length, breadth, draft, nx, nz, px=4.0, pz=4.0) -> tuple[np.ndarray, np.ndarray]:
    """Return a ship-like hull, the Wigley form with fuller lines: y = B/2 (1 - |2x/L|^px) (1 - |z/T|^pz)."""
    x = -length / 2 * np.cos(np.linspace(0, np.pi, nx + 1))
    z = -draft * np.sin(np.linspace(0, np.pi / 2, nz + 1))
    xx, zz = np.meshgrid(x, z, indexing="ij")
    y = breadth / 2 * (1 - abs(2 * xx / length) ** px) * (1 - abs(zz / draft) ** pz)
    port, faces = quads(np.stack([xx, y, zz], axis=-1))
    starboard = port * [1, -1, 1]
    return np.vstack([port, starboard]), np.vstack([faces, faces[:, ::-1] + len(port)])


def shapes(mesh: str) -> dict:
    """Return name: (maker of the mesh, dofs, zg, radii of gyration, top frequency) for the "fine" or "coarse" mesh."""
    import capytaine as cpt

    f = 1.0 if mesh == "fine" else 0.6

    def n(k: int, even: bool = False) -> int:
        return 2 * round(f * k / 2) if even else max(2, round(f * k))

    def cylinder(draft, nz):
        return lambda: cpt.mesh_vertical_cylinder(length=2 * draft, radius=1.0, resolution=(n(6), n(28, True), 2 * n(nz)))

    def given(points_faces):
        return lambda: cpt.Mesh(vertices=points_faces[0], faces=points_faces[1])

    def semi(x, y, z):
        leg = (abs(abs(x) - 3.2) < 0.8) & (abs(abs(y) - 2.8) < 0.8)
        return (abs(abs(y) - 2.8) < 0.8) & (z < -1.6) | leg

    def solid(x, y, z):
        return np.ones_like(x, bool)

    m = 1 if mesh == "coarse" else 2
    return {
        "sphere": (lambda: cpt.mesh_sphere(resolution=(n(24, True), n(30, True))), ["Surge", "Heave"], -0.2, {}, 9.5),
        "cylinder": (cylinder(1.0, 10), PLANAR, -0.45, {"Pitch": 0.7}, 8.5),
        "spar": (cylinder(7.0, 26), PLANAR, -4.2, {"Pitch": 2.6}, 6.5),
        "barge": (given(voxels(solid, (6, 2, 0.8), (n(28), n(10), n(4)))), [*PLANAR, "Sway", "Roll"], -0.2,
                  {"Roll": 0.72, "Pitch": 1.6}, 6.5),
        "ship": (given(hull(12, 1.8, 0.7, n(36), n(9))), [*PLANAR, "Sway", "Roll"], -0.05,
                 {"Roll": 0.68, "Pitch": 2.9}, 5.8),
        "semi": (given(voxels(semi, (8, 7.2, 2.4), (10 * m, 9 * m, 3 * m))), [*PLANAR, "Sway", "Roll"], 0.0,
                 {"Roll": 2.9, "Pitch": 2.8}, 5.0),
    }


def solve(name: str, mesh: str) -> dict:
    """Return the table of a body: added mass, damping, exciting force, inertia and hydrostatics."""
    import capytaine as cpt
    import xarray as xr

    make, dofs, zg, gyration, top = shapes(mesh)[name]
    mesh_ = make().immersed_part()
    body = cpt.FloatingBody(mesh=mesh_, lid_mesh=mesh_.generate_lid(), center_of_mass=(0, 0, zg),
                            dofs=cpt.rigid_body_dofs(only=dofs, rotation_center=(0, 0, zg)))
    omega = np.linspace(0.15, top, 56 if mesh == "fine" else 44)
    wanted = xr.Dataset(coords={"omega": np.append(omega, np.inf), "radiating_dof": dofs})
    waves = xr.Dataset(coords={"omega": omega, "wave_direction": [0.0, np.pi / 2]})
    solver = cpt.BEMSolver()
    rad = solver.fill_dataset(wanted, body, n_jobs=1, hydrostatics=False)
    dif = solver.fill_dataset(waves, body, n_jobs=1, hydrostatics=False)
    order = {"radiating_dof": dofs, "influenced_dof": dofs}
    rad = rad.sel(order).transpose("omega", "influenced_dof", "radiating_dof", ...)
    dif = dif.sel(influenced_dof=dofs).transpose("omega", "wave_direction", "influenced_dof", ...)
    force = dif.excitation_force if "excitation_force" in dif else dif.Froude_Krylov_force + dif.diffraction_force
    A, B = rad.added_mass.values, rad.radiation_damping.values
    mass = RHO * mesh_.volume
    C = body.compute_hydrostatic_stiffness(rho=RHO, g=G).sel(order).transpose("influenced_dof", "radiating_dof").values
    M = np.diag([mass * gyration[d] ** 2 if d in gyration else mass for d in dofs])
    X = np.conj(force.values.reshape(len(omega), 2, len(dofs)))
    return {"omega": omega, "A": A[:-1], "B": B[:-1], "A_inf": A[-1], "X": X, "M": M, "C": C, "dofs": np.array(dofs),
            "directions": np.array([0.0, np.pi / 2]), "zg": zg, "panels": mesh_.nb_faces}


def main() -> None:
    out = Path(sys.argv[1])
    for name in sys.argv[2:] or list(shapes("fine")):
        for mesh in ("coarse", "fine"):
            table = solve(name, mesh)
            np.savez_compressed(out / f"{name}_{mesh}.npz", **table)
            print(name, mesh, table["panels"], "panels", flush=True)


if __name__ == "__main__":
    main()
