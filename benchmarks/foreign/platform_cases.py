"""UMaine's semisubmersible of the IEA 15 MW turbine, six degrees of freedom, with and without MoorDyn's catenary lines.

python platform_cases.py IEA15_FOLDER OUT_FOLDER [case ...]. Mass, inertia, lines and quadratic drag as in the public
definition (Allen et al. 2020, NREL/TP-5000-76698, and its OpenFAST files), tower and nacelle taken as rigid and lumped.
"""

import gzip
import sys
import zlib
from pathlib import Path

import numpy as np
import special
import truth
import xarray as xr
from common import sensor_noise, units, write_label, write_record
from scipy.spatial.transform import Rotation

DOFS = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
RHO, G, DEPTH = 1025.0, 9.81, 200.0
LINE = dict(depth=200.0, fair=58.0, height=-14.0, anchor=837.6, length=850.0, mass=685.0, diameter=0.333, EA=3.27e9)
DRAG = np.array([9.23e5, 9.23e5, 2.296e6, 1.676e10, 1.676e10, 4.798e10])
PARTS = [
    (1.7839e7, -14.94, 1.251e10, 2.367e10),
    (1.263e6, 56.5, 1.64e9, 2e7),
    (1.017e6, 148.7, 0.0, 3.4e8),
]  # mass, z, I_xx, I_zz
SIZES = dict(Surge=9.0, Sway=7.0, Heave=2.5, Roll=0.10, Pitch=0.10, Yaw=0.17)
CASES = {  # lines, drag, decays; unseen decays; the nominal model has no lines
    "p01": (True, 0.0, "Surge Sway Heave Roll Pitch Yaw waves Surge* waves*"),
    "p02": (True, 1.0, "Surge Sway Heave Roll Pitch Yaw waves waves Surge* Pitch* waves*"),
    "p03": (False, 1.0, "Heave Heave Roll Pitch waves Pitch* waves*"),
    "p04": (False, 0.0, "Heave Roll Pitch waves Heave* waves*"),
}


def mass_matrix():
    M = np.zeros((6, 6))
    for m, z, turn, yaw in PARTS:
        M[:3, :3] += m * np.eye(3)
        M[0, 4] += m * z
        M[1, 3] -= m * z
        M[3, 3] += turn + m * z**2
        M[4, 4] += turn + m * z**2
        M[5, 5] += yaw
    M[4, 0], M[3, 1] = M[0, 4], M[1, 3]
    return M


def load(folder, heading=30.0):
    folder = Path(folder)
    A, B, limit = {}, {}, np.zeros((6, 6))
    for line in open(folder / "UMaineSemi.1"):
        f = [float(v) for v in line.split()]
        i, j = int(f[1]) - 1, int(f[2]) - 1
        if f[0] == 0:
            limit[i, j] = RHO * f[3]
        elif f[0] > 0:
            w = 2 * np.pi / f[0]
            A.setdefault(w, np.zeros((6, 6)))[i, j] = RHO * f[3]
            B.setdefault(w, np.zeros((6, 6)))[i, j] = RHO * w * f[4]
    omega = np.array(sorted(A))
    X = np.zeros((omega.size, 6), complex)
    with gzip.open(folder / "UMaineSemi.3.gz", "rt") as file:
        for line in file:
            f = [float(v) for v in line.split()]
            if abs(f[1] - heading) < 1e-6:
                X[np.argmin(np.abs(omega - 2 * np.pi / f[0])), int(f[2]) - 1] = (
                    RHO * G * (f[5] - 1j * f[6])
                )  # to e^{-iwt}
    C = np.zeros((6, 6))
    for line in open(folder / "UMaineSemi.hst"):
        f = line.split()
        C[int(f[0]) - 1, int(f[1]) - 1] = RHO * G * float(f[2])
    weight = sum(m * z for m, z, _, _ in PARTS) * G
    C[3, 3] -= weight
    C[4, 4] -= weight
    Aw, Bw = np.stack([sym(A[w]) for w in omega]), truth.positive(np.stack([sym(B[w]) for w in omega]))
    return truth.Body(DOFS, mass_matrix(), sym(limit), sym(C), omega, Bw, Aw, X, np.zeros(6))


def consistent(body, dt, span):
    """A(w) and B(w) that belong to the kernel which the simulation uses."""
    from dataclasses import replace

    K = truth.kernel(body.omega, body.B, dt, span)
    t = np.arange(len(K)) * dt
    weight = np.full(t.size, dt)
    weight[[0, -1]] *= 0.5
    A = np.stack([body.A_inf - np.tensordot(weight * np.sin(w * t), K, 1) / w for w in body.omega])
    print(
        "A(w) of the file against the kernel's, share of M + A_inf:",
        np.round(
            [np.max(np.abs(A[2:60, i, i] - body.A[2:60, i, i])) / (body.M + body.A_inf)[i, i] for i in range(6)], 4
        ),
    )
    return replace(body, A=A)


def sym(P):
    return 0.5 * (P + P.T)


def write_model(path, body, errors):
    names, omega = np.array(DOFS, object), np.r_[body.omega, np.inf]
    e = {k: 1 + v for k, v in errors.items()}
    A_inf = body.A_inf * e["A_inf"]
    A = np.concatenate([A_inf + (body.A - body.A_inf) * e["kernel"], A_inf[None]])
    B = np.concatenate([body.B * e["kernel"], 0 * body.B[:1]])
    X = np.stack([body.X.real, body.X.imag], 1)[:, :, None, :]
    X = np.concatenate([X, np.full((1, *X.shape[1:]), np.nan)])
    dims = ("omega", "influenced_dof", "radiating_dof")
    xr.Dataset(
        {
            "added_mass": (dims, A),
            "radiation_damping": (dims, B),
            "inertia_matrix": (dims[1:], body.M * e["mass"]),
            "hydrostatic_stiffness": (dims[1:], body.stiffness * e["stiffness"]),
            "excitation_force": (("omega", "complex", "wave_direction", "influenced_dof"), X),
        },
        coords={
            "omega": omega,
            "complex": ["re", "im"],
            "wave_direction": [np.radians(30.0)],
            "influenced_dof": names,
            "radiating_dof": names,
            "rho": RHO,
            "g": G,
            "water_depth": DEPTH,
            "forward_speed": 0.0,
        },
    ).to_netcdf(path)


def line_force(x, headings=(180.0, 60.0, -60.0)):
    """Static force of the lines on the body at the origin (elastic catenaries)."""
    total = np.zeros(6)
    for h in np.radians(headings):
        arm = np.array([LINE["fair"] * np.cos(h), LINE["fair"] * np.sin(h), LINE["height"]])
        arm = Rotation.from_rotvec(x[3:]).apply(arm)
        place = arm + x[:3]
        away = np.array([LINE["anchor"] * np.cos(h), LINE["anchor"] * np.sin(h)]) - place[:2]
        reach = np.hypot(*away)
        H, V = special.catenary(dict(LINE, height=place[2]), reach)
        f = np.array([*(H * away / reach), -V])
        total += np.r_[f, np.cross(arm, f)]
    return total


def static_curves():
    rest, curves = line_force(np.zeros(6)), {}
    for i, dof in enumerate(DOFS):
        offsets = np.linspace(-1.3, 1.3, 27) * SIZES[dof]
        curves[dof] = {
            "offset": offsets.tolist(),
            "force": [(line_force(np.eye(6)[i] * s) - rest).tolist() for s in offsets],
        }
    return curves, rest.tolist()


def simulate(body, effects, dt, force, x0, moored):
    if not moored:
        return truth.convolve(body, effects, dt, force, x0, memory_time=70.0)
    rest = special.Lines(LINE, DOFS, segments=26)
    rest.start(np.zeros(6))
    neutral = [rest.force(k * 0.5, np.zeros(6), np.zeros(6), 0.5) for k in range(100)][-1]
    rest.close()
    lines = special.Lines(LINE, DOFS, segments=26)
    lines.start(x0)

    def extra(k, t, x, v):
        return (lines.force(0.0, x, v, 1e-4) if k == 0 else lines.force(t - dt, x - dt * v, v, dt)) - neutral

    out = special.march(body, effects, dt, force, x0, extra, corrections=0, memory_time=70.0)
    lines.close()
    return out


def make(case, folder, out):
    moored, drag, plan = CASES[case]
    rng = np.random.default_rng(zlib.crc32(case.encode()))
    dt = 0.1
    body = consistent(load(folder), dt, 70.0)
    effects = truth.Effects(6)
    effects.table[:, truth.C["quadratic_drag"]] = drag * DRAG
    errors = {k: float(rng.uniform(-0.015, 0.015)) for k in ("mass", "stiffness", "A_inf", "kernel")}
    place = Path(out) / "cases" / case
    place.mkdir(parents=True, exist_ok=True)
    write_model(place / "model.nc", body, errors)
    files, counts, reached = [], {}, np.zeros(6)
    for word in plan.split():
        kind, unseen = word.rstrip("*"), word.endswith("*")
        x0 = np.zeros(6)
        if kind == "waves":
            steps = int(rng.uniform(900, 1300) / dt)
            t = np.arange(steps) * dt
            hs, tp = rng.uniform(4.0, 9.0), rng.uniform(9.5, 14.0)
            eta, force = truth.excitation(body, *truth.irregular(rng, hs, tp), t)
            rise = truth.ramp(t, 60.0)
            eta, force = eta * rise, force * rise[:, None]
        else:
            length = {"Surge": 700, "Sway": 700, "Yaw": 500}.get(kind, 320)
            steps = int(length / dt)
            eta, force = np.zeros(steps), np.zeros((steps, 6))
            x0[DOFS.index(kind)] = SIZES[kind] * rng.uniform(0.75, 1.05) * rng.choice([-1, 1])
        x, _, _ = simulate(body, effects, dt, force, x0, moored)
        reached = np.maximum(reached, np.abs(x).max(0))
        every = 2
        t = np.arange(0, steps, every) * dt
        columns = {
            d: (
                units(d)[0],
                x[::every, i]
                + sensor_noise(rng, x[::every, i], 0.005, "white", dt, max(0.05 * SIZES[d], 0.3 * np.std(x[:, i]))),
            )
            for i, d in enumerate(DOFS)
        }
        if kind == "waves":
            columns.update({f"{d}_force": (units(d)[3], force[::every, i]) for i, d in enumerate(DOFS)})
            columns["wave_elevation"] = ("m", eta[::every])
        key = ("unseen_" if unseen else "record_") + (kind if kind == "waves" else f"decay_{kind.lower()}_")
        counts[key] = counts.get(key, 0) + 1
        file = f"{key}{counts[key]}.csv"
        write_record(place / file, "waves" if kind == "waves" else "decay", t, columns)
        files.append(
            {
                "file": file,
                "kind": kind,
                "withheld": unseen,
                "starts_at_rest": True,
                "largest": np.abs(x).max(0).round(4).tolist(),
            }
        )
    curves, rest = static_curves()
    causes = [{"name": "mooring_lines", "dof": d} for d in DOFS if moored]
    causes += [
        {"name": "quadratic_drag", "dof": d, "parameters": {"quadratic_drag": float(b)}}
        for d, b in zip(DOFS, drag * DRAG)
        if drag
    ]
    twins = {
        "mooring_lines": ["mooring_lines", "linear_stiffness", "catenary", "cubic_stiffness", "quadratic_stiffness"]
    }
    label = {
        "id": case,
        "null": not causes,
        "causes": causes,
        "accept": [twins.get(c["name"], [c["name"]]) for c in causes],
        "dofs": DOFS,
        "body": "UMaine semisubmersible",
        "program": "moordyn" if moored else "convolve",
        "records": files,
        "nominal_error": errors,
        "tolerance": 0.02,
        "lines": LINE if moored else None,
        "static_curve": curves if moored else None,
        "pretension_force": rest if moored else None,
        "reached": reached.tolist(),
    }
    write_label(out, case, label)
    print("\nDONE", case, "reached", reached.round(3), flush=True)


if __name__ == "__main__":
    for one in sys.argv[3:] or CASES:
        make(one, sys.argv[1], sys.argv[2])
