"""Identification cases: motion of a body whose radiation kernel is known, and a prior model that is 15 % wrong.

python identify_cases.py BEM_FOLDER REFERENCE_FOLDER OUT_FOLDER [body ...]; one case per body, sea, length and seed.
OUT/identify/<id>/model.nc and record.csv; OUT/identify_labels/<id>.json and .npz (omega, A, B, kernel, force series).
Seconds are those of a section of 0.1 m half breadth (natural period 0.87 s); other bodies are scaled by their period.
"""

import functools
import json
import sys
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import special
import truth
import xarray as xr
from common import units, write_record
from scipy.interpolate import CubicSpline

BODIES = {
    "section": "Heave",
    "section0": "Heave",
    "sphere": "Heave",
    "barge": "Roll",
    "swayroll": "Sway Roll",
    "heavepitch": "Heave Pitch",
}
FILES = {"sphere": "sphere_m", "barge": "barge_m", "swayroll": "box_m", "heavepitch": "ship_m"}
GROUPS = [
    ("jonswap", 30),
    ("jonswap", 120),
    ("jonswap", 600),
    ("swellwind", 30),
    ("swellwind", 120),
    ("flat", 30),
    ("flat", 120),
    ("lumpy", 30),
    ("lumpy", 120),
    ("known_clean", 30),
    ("known_mass3", 30),
    ("known_drag30", 30),
    ("known_elevation", 30),
]


def section(reference, at_zero=0.0):
    """Lewis section of the reference table, one metre long; at_zero: damping at zero frequency as in finite depth."""
    path = Path(reference) / "lewis_H0_1_sigma_0p9_deepwater_per_metre.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    w = table["omega_rad_s"]
    grid = np.linspace(0.25, w[-1], 90)
    low = CubicSpline(np.r_[0.0, w], np.r_[0.0, table["B33"]])
    B = low(grid)
    if at_zero:
        B = np.sqrt(B**2 + (at_zero * np.exp(-((grid / 2.5) ** 2))) ** 2)
    size = np.sqrt(1000.0 * 9.81**2 * B / grid)  # Haskind's relation in two dimensions, deep water
    X = size * np.exp(-1j * np.radians(np.interp(grid, w, table["X3_lead_deg"])))
    one = np.ones((1, 1))
    return truth.Body(
        ("Heave",),
        18.0 * one,
        18.5917 * one,
        1962.0 * one,
        grid,
        B[:, None, None],
        0 * B[:, None, None],
        X[:, None],
        np.zeros(1),
    )


def truth_body(name, bem, reference):
    if name.startswith("section"):
        return section(reference, 93.0 if name == "section0" else 0.0)
    body = special.body(FILES[name], bem, BODIES[name].split())
    fast = np.sqrt(np.diag(body.stiffness) / np.diag(body.M + body.A_inf)).max()
    return truth.rig(body, 5 * 2 * np.pi / fast)


def kernel(body, dt, at_zero):
    """As truth.kernel, but with damping that need not vanish at zero frequency."""
    span = 60.0 / body.omega[-1] * 3.2 * (2.0 if len(body.omega) > 80 else 1.0)
    if not at_zero:
        return truth.kernel(body.omega, body.B, dt, span)
    omega, B = np.r_[1e-6, body.omega], np.concatenate([np.full((1, 1, 1), at_zero), body.B])
    w = np.linspace(0, 3 * omega[-1], 2400)
    b = CubicSpline(omega, B[:, 0, 0])(np.minimum(w, omega[-1])) * (np.maximum(w, omega[-1]) / omega[-1]) ** -4.0
    weight = np.full(w.size, w[1])
    weight[[0, -1]] *= 0.5
    t = np.arange(int(span / dt) + 1) * dt
    return (2 / np.pi * np.cos(np.outer(t, w)) @ (weight * b))[:, None, None]


def coefficients(omega, K, dt, A_inf):
    """A(w), B(w) of a kernel by Fourier integrals: what the kernel really has, its taper included."""
    t = np.arange(len(K)) * dt
    weight = np.full(t.size, dt)
    weight[[0, -1]] *= 0.5
    A = np.stack([A_inf - np.tensordot(weight * np.sin(w * t), K, 1) / w for w in omega])
    B = np.stack([np.tensordot(weight * np.cos(w * t), K, 1) for w in omega])
    return A, B


def smooth(rng, omega, scale):
    """Smooth random function of frequency, unit variance, correlation length `scale`."""
    d = omega[:, None] - omega
    return np.linalg.cholesky(np.exp(-0.5 * (d / scale) ** 2) + 1e-8 * np.eye(omega.size)) @ rng.standard_normal(
        omega.size
    )


def spectrum(rng, sea, omega, w0):
    """Elevation spectrum of unit variance on omega, and its numbers; frequencies are scaled with w0 / 7.2 rad/s."""
    told = {}
    if sea == "swellwind":
        p1, p2 = w0 * rng.uniform(0.50, 0.65), w0 * rng.uniform(0.95, 1.25)
        share = rng.uniform(0.3, 0.6)
        s = truth.jonswap(omega, 4 * np.sqrt(share), 2 * np.pi / p1, 6.0) + truth.jonswap(
            omega, 4 * np.sqrt(1 - share), 2 * np.pi / p2, 1.5
        )
        told = {"peaks": [p1, p2], "swell_share": share}
    elif sea == "flat":
        edges = np.array([4.0, 12.0]) * w0 / 7.2
        s = ((omega > edges[0]) & (omega < edges[1])).astype(float)
        told = {"band": edges.tolist()}
    elif sea == "lumpy":
        peak = w0 * rng.uniform(0.7, 0.9)
        base = np.where(omega > peak, (omega / peak) ** -4.0, np.exp(-8 * (1 - omega / peak)))
        s = base * np.exp(0.8 * smooth(rng, omega, 0.08 * w0))
        told = {"peak": peak, "tail": -4}
    else:
        peak, gamma = w0 * rng.uniform(0.75, 1.1), rng.uniform(1.0, 5.0)
        s = truth.jonswap(omega, 4.0, 2 * np.pi / peak, gamma)
        told = {"peak": peak, "gamma": gamma}
    return s / np.trapezoid(s, omega), told


@functools.cache
def known(name, bem, reference):
    """Body, time step, kernel and coefficients of the truth."""
    body = truth_body(name, bem, reference)
    w0 = np.sqrt(np.diag(body.stiffness) / np.diag(body.M + body.A_inf)).max()
    dt = 0.01 * 7.2 / w0
    K = kernel(body, dt, 93.0 if name == "section0" else 0.0)
    return body, w0, dt, K, *coefficients(body.omega, K, dt, body.A_inf)


def one_case(name, sea, length, seed, bem, reference, out):
    case = f"{name}_{sea}_{length}_{seed:02d}"
    rng = np.random.default_rng(zlib.crc32(case.encode()))
    body, w0, dt, K, A, B = known(name, bem, reference)
    n, scale, at_zero = len(body.dofs), 7.2 / w0, 93.0 if name == "section0" else 0.0
    lead = 40 * scale
    steps = int((lead + length * scale) / dt)
    t = np.arange(steps) * dt
    edges = np.linspace(max(0.3 * w0, body.omega[0]), min(2.6 * w0, body.omega[-1]), max(300, int(4 * length)))
    omega = edges[:-1] + rng.uniform(0, 1, edges.size - 1) * np.diff(edges)
    density, told = spectrum(rng, "jonswap" if sea.startswith("known") else sea, omega, w0)
    amplitude, phase = np.sqrt(2 * density * np.diff(edges)), rng.uniform(0, 2 * np.pi, omega.size)
    height = 0.012 * scale**2
    eta, force = synthesize(body, omega, amplitude * height / 2, phase, t)
    effects = truth.Effects(n)
    if sea == "known_mass3":
        told["mass_error_of_the_model"] = -0.03 / 1.03
    body_true = replace(body, M=body.M * 1.03) if sea == "known_mass3" else body
    rise = truth.ramp(t, 10 * scale)
    x = truth.linear(body_true, dt, force * rise[:, None], K=K)
    if sea == "known_drag30":
        i = n - 1
        speed = np.std(np.gradient(x[:, i], dt))
        level = 0.3 * 2 * 0.1 * w0 * (body.M + body.A_inf)[i, i]
        told["quadratic_drag"] = level / (np.sqrt(8 / np.pi) * speed)
        told["drag_over_linear_damping_10_percent_critical"] = 0.3
        effects.put(i, quadratic_drag=told["quadratic_drag"])
        table = effects.table
        table[:, 0] += body.D
        fine = 4
        force4 = np.stack([np.interp(np.arange(steps * fine) * dt / fine, t, c) for c in (force * rise[:, None]).T], 1)
        zero = np.zeros(n)
        x = truth._newmark(
            body.M + body.A_inf,
            body.stiffness,
            np.ascontiguousarray(kernel(body, dt / fine, at_zero)),
            dt / fine,
            np.ascontiguousarray(force4),
            zero,
            zero,
            table,
            0.0,
            np.zeros(n, np.bool_),
        )[0][::fine]
    cut = int(lead / dt)
    pick = slice(cut, None, 2)
    columns = {}
    for i, dof in enumerate(body.dofs):
        columns[dof] = (units(dof)[0], x[pick, i] + 0.01 * np.std(x[cut:, i]) * rng.standard_normal(x[pick, i].size))
    if sea in ("known_clean", "known_mass3", "known_drag30"):
        columns.update({f"{d}_force": (units(d)[3], force[pick, i]) for i, d in enumerate(body.dofs)})
    if sea == "known_elevation":
        columns["wave_elevation"] = ("m", eta[pick])
    folder = Path(out) / "identify" / case
    folder.mkdir(parents=True, exist_ok=True)
    kind = "waves" if sea == "known_elevation" else "forced" if sea.startswith("known") else "motion-only"
    write_record(folder / "record.csv", kind, t[pick] - t[cut], columns)
    prior_error = write_prior(rng, folder / "model.nc", body, A, B, 2 * dt, at_zero)
    labels = Path(out) / "identify_labels"
    labels.mkdir(parents=True, exist_ok=True)
    tk = np.arange(len(K)) * dt
    np.savez_compressed(
        labels / f"{case}.npz",
        omega=body.omega,
        A=A,
        B=B,
        A_inf=body.A_inf,
        M=body_true.M,
        C=body.stiffness,
        D=body.D,
        K_time=tk[::2],
        K=K[::2].astype(np.float32),
        time=(t[pick] - t[cut]),
        force=force[pick].astype(np.float32),
        elevation=eta[pick].astype(np.float32),
        motion=x[pick],
        sea_omega=omega,
        sea_density=density * (height / 2) ** 2,
    )
    label = {
        "id": case,
        "body": name,
        "dofs": list(body.dofs),
        "sea": sea,
        "length_s": length,
        "time_scale": scale,
        "seed": seed,
        "noise": 0.01,
        "prior_relative_sd": 0.15,
        "prior_error_of_K": prior_error,
        "known": told,
        "constructed_low_frequency_damping": at_zero,
    }
    (labels / f"{case}.json").write_text(json.dumps(label, indent=1))
    return prior_error


def synthesize(body, omega, amplitude, phase, t):
    """Elevation and force in blocks, so that long records fit in memory."""
    eta, force = np.empty(t.size), np.empty((t.size, len(body.dofs)))
    for start in range(0, t.size, 4000):
        eta[start : start + 4000], force[start : start + 4000] = truth.excitation(
            body, omega, amplitude, phase, t[start : start + 4000]
        )
    return eta, force


def write_prior(rng, path, body, true_A, true_B, dt, at_zero):
    """The prior model: damping (by Haskind, half as much in log X) off by a smooth 15 %; A follows by the kernel."""
    span = body.omega[-1] - body.omega[0]
    off = np.stack([0.15 * smooth(rng, body.omega, 0.25 * span) for _ in body.dofs], 1)
    half = np.exp(0.5 * off)
    wrong = replace(body, B=half[:, :, None] * body.B * half[:, None, :], X=body.X * half)
    K = kernel(wrong, dt, at_zero * float(np.exp(off[0, 0])))
    A, B = coefficients(body.omega, K, dt, body.A_inf)
    error = np.linalg.norm(B - true_B + 1j * body.omega[:, None, None] * (A - true_A)) / np.linalg.norm(
        true_B + 1j * body.omega[:, None, None] * (true_A - body.A_inf)
    )
    names = np.array(body.dofs, object)
    omega = np.r_[body.omega, np.inf]
    dims = ("omega", "influenced_dof", "radiating_dof")
    X = wrong.X[:, None, :]
    X = np.stack([X.real, X.imag], 1)
    X = np.concatenate([X, np.full((1, *X.shape[1:]), np.nan)])
    data = xr.Dataset(
        {
            "added_mass": (dims, np.concatenate([A, body.A_inf[None]])),
            "radiation_damping": (dims, np.concatenate([B, 0 * B[:1]])),
            "inertia_matrix": (dims[1:], body.M),
            "hydrostatic_stiffness": (dims[1:], body.stiffness),
            "excitation_force": (("omega", "complex", "wave_direction", "influenced_dof"), X),
        },
        coords={
            "omega": omega,
            "complex": ["re", "im"],
            "wave_direction": [0.0],
            "influenced_dof": names,
            "radiating_dof": names,
            "rho": 1000.0,
            "g": 9.81,
            "water_depth": np.inf,
            "forward_speed": 0.0,
        },
    )
    if np.any(body.D):
        data["friction"] = (dims[1:], np.diag(body.D))
    data.to_netcdf(path)
    return float(error)


if __name__ == "__main__":
    bem_folder, reference_folder, out_folder = sys.argv[1:4]
    for seeds in ((1, 2, 3, 4, 5, 6), (7, 8, 9, 10, 11, 12)):
        for one in sys.argv[4:] or BODIES:
            for sea_name, seconds in GROUPS:
                chosen = [k for k in seeds if (one == "section" or seconds < 600 or k < 3)]
                chosen = [
                    k
                    for k in chosen
                    if not (Path(out_folder) / "identify_labels" / f"{one}_{sea_name}_{seconds}_{k:02d}.json").exists()
                ]
                errors = [one_case(one, sea_name, seconds, k, bem_folder, reference_folder, out_folder) for k in chosen]
                if chosen:
                    print(one, sea_name, seconds, chosen, "prior error of K", np.round(np.mean(errors), 3), flush=True)
