"""Bodies of the foreign cases: meshes, diffraction and radiation by Capytaine, one netCDF file each.

Run: python bodies.py FOLDER [name ...]. Nothing of radiation_ss is imported.
"""

import sys
from pathlib import Path

import capytaine as cpt
import numpy as np


def grid_mesh(points, name):
    """Quadrilaterals of a structured grid of points (m, n, 3)."""
    m, n, _ = points.shape
    index = np.arange(m * n).reshape(m, n)
    faces = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], -1).reshape(-1, 4)
    mesh = cpt.Mesh(points.reshape(-1, 3), faces, name=name)
    mesh.merge_duplicates()
    mesh.heal_mesh()
    return mesh


def ship(length, beam, draft, freeboard=0.0, flare=0.0, fullness=2.0, bilge=3.0, nx=26, ng=9, name="ship"):
    """Hull with parabolic-like waterlines (exponent `fullness`) and superelliptic sections, flared above the water."""
    x = 0.5 * length * np.cos(np.linspace(np.pi, 0.0, nx))
    half = 0.5 * beam * np.clip(1.0 - np.abs(2 * x / length) ** fullness, 1e-3, None)
    angle = np.linspace(-np.pi / 2, np.pi / 2, 2 * ng - 1)
    y = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** (2 / bilge)
    z = -(np.abs(np.cos(angle)) ** (2 / bilge))
    if freeboard:
        up = np.linspace(0, 1, 5)[1:]
        y = np.concatenate([-(1 + flare * up[::-1]), y, 1 + flare * up])
        z = np.concatenate([freeboard / draft * up[::-1], z, freeboard / draft * up])
    points = np.stack(
        [np.broadcast_to(x[:, None], (nx, y.size)), half[:, None] * y, np.broadcast_to(draft * z, (nx, y.size))], -1
    )
    return grid_mesh(points, name)


def revolution(radius_depth, n_around=28, name="body"):
    """Body of revolution from (radius, z) pairs, from the bottom up."""
    rz = np.asarray(radius_depth, float)
    angle = np.linspace(0, 2 * np.pi, n_around + 1)
    points = np.stack(
        [rz[:, :1] * np.cos(angle), rz[:, :1] * np.sin(angle), np.broadcast_to(rz[:, 1:], (len(rz), n_around + 1))], -1
    )
    mesh = grid_mesh(points[::-1].copy(), name)
    return mesh


def hemisphere(radius, n=11):
    a = np.linspace(0, np.pi / 2, n)
    return revolution(np.c_[radius * np.sin(a), -radius * np.cos(a)], name="sphere")


def cylinder(radius, draft, n=8, name="cylinder"):
    r = radius * np.sin(np.linspace(0, np.pi / 2, 6))
    z = -draft * (1 + np.cos(np.linspace(0, np.pi, n))) / 2
    return revolution(np.r_[np.c_[r, np.full(6, -draft)], np.c_[np.full(n - 1, radius), z[1:]]], name=name)


def cone(radius, draft, n=12):
    s = np.sin(np.linspace(0, np.pi / 2, n))
    return revolution(np.c_[radius * s, -draft * (1 - s)], name="cone")


def box(length, beam, draft, n=(18, 10, 6)):
    mesh = cpt.mesh_parallelepiped(
        size=(length, beam, draft), resolution=n, center=(0, 0, -draft / 2), missing_sides={"top"}, name="box"
    )
    return mesh


KEEP = ("g", "rho", "water_depth", "forward_speed", "rotation_center")

# name: mesh, height of the centre of gravity [m], gyradii (roll, pitch) [m], dofs, wave direction [rad], length [m],
# depth
DEG90 = np.pi / 2
BODIES = {
    "sphere_m": lambda: (hemisphere(0.25), -0.05, (0.15, 0.15), ["Heave"], 0.0, 0.25, np.inf),
    "sphere_f": lambda: (hemisphere(5.0), -1.5, (3.0, 3.0), ["Surge", "Heave"], 0.0, 5.0, np.inf),
    "cyl_m": lambda: (cylinder(0.3, 0.35), -0.16, (0.2, 0.2), ["Heave", "Pitch"], 0.0, 0.3, 3.0),
    "cyl_f": lambda: (cylinder(8.0, 14.0), -7.5, (5.5, 5.5), ["Surge", "Heave", "Pitch"], 0.0, 8.0, np.inf),
    "cone_m": lambda: (cone(0.35, 0.40), -0.12, (0.2, 0.2), ["Heave"], 0.0, 0.35, np.inf),
    "barge_m": lambda: (box(2.0, 0.5, 0.15), 0.02, (0.18, 0.55), ["Heave", "Roll"], DEG90, 0.5, np.inf),
    "box_m": lambda: (box(0.6, 0.4, 0.2), -0.08, (0.14, 0.19), ["Sway", "Heave", "Roll"], DEG90, 0.4, 1.5),
    "barge_f": lambda: (box(90.0, 27.0, 5.5), 1.0, (9.5, 26.0), ["Heave", "Pitch"], 0.0, 30.0, np.inf),
    "ship_m": lambda: (ship(3.0, 0.45, 0.17, fullness=2.2), 0.0, (0.16, 0.75), ["Heave", "Pitch"], 0.0, 0.6, np.inf),
    "shiproll_m": lambda: (
        ship(3.2, 0.50, 0.19, fullness=4.0, bilge=4.0),
        -0.03,
        (0.18, 0.80),
        ["Roll"],
        DEG90,
        0.5,
        np.inf,
    ),
    "ship_f": lambda: (ship(120.0, 19.0, 6.5, fullness=3.0), 0.2, (7.0, 30.0), ["Heave", "Roll"], DEG90, 19.0, 60.0),
    "float_f": lambda: (cylinder(10.0, 3.0, name="float"), -1.0, (5.0, 5.0), ["Heave", "Pitch"], 0.0, 10.0, 70.0),
}


def solve(name, folder, frequencies=None):
    mesh, zg, (kx, ky), dofs, direction, size, depth = BODIES[name]()
    if np.mean(np.einsum("ij,ij->i", mesh.faces_normals, mesh.faces_centers - [0, 0, 0.1 * size])) < 0:
        mesh.flip_normals()
    lid = mesh.generate_lid()
    body = cpt.FloatingBody(
        mesh, lid_mesh=lid, dofs=cpt.rigid_body_dofs(rotation_center=(0, 0, zg)), center_of_mass=(0, 0, zg), name=name
    )
    volume = mesh.volume
    w = np.sqrt(9.81 / size) * (np.r_[np.linspace(0.1, 3.2, 63)] if frequencies is None else frequencies)
    keep = {"Surge": 0, "Sway": 1, "Heave": 2, "Roll": 3, "Pitch": 4}
    stiffness = body.compute_hydrostatic_stiffness(rho=1000.0)
    mass = 1000.0 * volume
    inertia = np.diag(mass * np.array([1, 1, 1, kx**2, ky**2]))
    body = cpt.FloatingBody(
        mesh, lid_mesh=lid, dofs={d: body.dofs[d] for d in dofs}, center_of_mass=(0, 0, zg), name=name
    )
    body.rotation_center = np.array([0.0, 0.0, zg])
    solver = cpt.BEMSolver()
    problems = [
        cpt.RadiationProblem(body=body, radiating_dof=d, omega=o, water_depth=depth, rho=1000.0)
        for o in [*w, np.inf]
        for d in dofs
    ]
    problems += [
        cpt.DiffractionProblem(body=body, wave_direction=direction, omega=o, water_depth=depth, rho=1000.0) for o in w
    ]
    results = solver.solve_all(problems, keep_details=False, progress_bar=False)
    data = cpt.assemble_dataset(results)
    index = [keep[d] for d in dofs]
    data["inertia_matrix"] = (("influenced_dof", "radiating_dof"), inertia[np.ix_(index, index)])
    names = ["Surge", "Sway", "Heave", "Roll", "Pitch"]
    C = stiffness.sel(influenced_dof=names, radiating_dof=names).values[np.ix_(index, index)]
    data["hydrostatic_stiffness"] = (("influenced_dof", "radiating_dof"), C)
    data = data.sel(radiating_dof=dofs, influenced_dof=dofs)
    data["excitation_force"] = data["Froude_Krylov_force"] + data["diffraction_force"]
    data.attrs.clear()
    data = data.assign_coords(influenced_dof=np.array(dofs, object), radiating_dof=np.array(dofs, object))
    data = data.drop_vars([v for v in data.coords if v not in KEEP and v not in data.dims])
    data = cpt.io.xarray.separate_complex_values(data)
    data.to_netcdf(Path(folder) / f"{name}.nc")
    print(name, mesh.nb_faces, "panels, volume", round(volume, 5), "m^3, C", np.round(np.diag(C), 3), flush=True)


if __name__ == "__main__":
    cpt.set_logging("ERROR")
    for body_name in sys.argv[2:] or BODIES:
        solve(body_name, sys.argv[1])
