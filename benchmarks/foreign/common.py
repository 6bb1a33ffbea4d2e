"""What the case makers share: nominal model files, records, sensors, the best retuned linear model."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import truth
import xarray as xr
from scipy.optimize import least_squares


def write_model(bem, path, body, errors):
    """model.nc: the truth's coefficients with the errors of the nominal model (relative, by name)."""
    data = xr.open_dataset(bem).load()
    dofs = list(body.dofs)
    data = data.sel(radiating_dof=dofs, influenced_dof=dofs)
    nominal = perturb(body, errors)
    finite = np.isfinite(data.omega.values)
    A = np.empty((data.omega.size, len(dofs), len(dofs)))
    B = np.zeros_like(A)
    A[~finite], A[finite], B[finite] = nominal.A_inf, nominal.A, nominal.B
    dims = ("omega", "influenced_dof", "radiating_dof")
    data["added_mass"], data["radiation_damping"] = (dims, A), (dims, B)
    data["inertia_matrix"] = (dims[1:], nominal.M)
    data["hydrostatic_stiffness"] = (dims[1:], nominal.stiffness)
    if np.any(nominal.D):
        data["friction"] = (dims[1:], np.diag(nominal.D))
    data = data.assign_coords(influenced_dof=np.array(dofs, object), radiating_dof=np.array(dofs, object))
    data.to_netcdf(path)


def perturb(body, errors):
    e = {"mass": 0.0, "stiffness": 0.0, "A_inf": 0.0, "kernel": 0.0, **errors}
    A_inf = body.A_inf * (1 + e["A_inf"])
    return replace(
        body,
        M=body.M * (1 + e["mass"]),
        A_inf=A_inf,
        stiffness=body.stiffness * (1 + e["stiffness"]),
        B=body.B * (1 + e["kernel"]),
        A=A_inf + (body.A - body.A_inf) * (1 + e["kernel"]),
    )


def pooled(pairs):
    """Root of the mean squared error over that of the measured motion, each degree of freedom scaled by its rms."""
    n = pairs[0][0].shape[1]
    up = down = 0.0
    for i in range(n):
        energy = sum(np.sum(m[:, i] ** 2) for m, _ in pairs) + 1e-300
        up += sum(np.sum((m[:, i] - p[:, i]) ** 2) for m, p in pairs) / energy
        down += 1.0
    return float(np.sqrt(up / down))


def predict(body, errors, runs, base=None):
    nominal = perturb(body, errors)
    key = round(runs[0]["dt"], 12)
    out = []
    for run in runs:
        K = (1 + errors.get("kernel", 0.0)) * base[key]
        out.append(truth.linear(nominal, run["dt"], run["force"], run["x0"], K=K)[run["cut"] :])
    return out


def gaps(body, errors, runs, tolerance=0.02, bound=2.0):
    """Gap of the nominal model and of the best one within `bound` standard deviations of the tolerance."""
    names = ("mass", "stiffness", "A_inf", "kernel")
    dt = runs[0]["dt"]
    K = body.kernel(dt, 60.0 / body.omega[-1] * 3.2)
    top = 20 * np.sqrt(np.max(np.diag(body.stiffness) / np.diag(body.M + body.A_inf)))
    ready = [truth.prepare(run["dt"], run["force"], run["x0"], K, top) for run in runs]
    measured = [run["shown"][run["cut"] :] for run in runs]
    scale = np.sqrt(sum(np.sum(m**2, 0) for m in measured)) + 1e-300

    def residual(p):
        total = {k: (1 + errors.get(k, 0.0)) * (1 + q) - 1 for k, q in zip(names, p)}
        nominal = perturb(body, total)
        guess = [truth.respond(nominal, one, 1 + total["kernel"])[run["cut"] :] for one, run in zip(ready, runs)]
        return np.concatenate([((m - g) / scale).ravel() for m, g in zip(measured, guess)]) / np.sqrt(scale.size)

    before = float(np.linalg.norm(residual(np.zeros(4))))
    best = least_squares(
        residual, np.zeros(4), bounds=(-bound * tolerance, bound * tolerance), x_scale=0.01, max_nfev=6, diff_step=1e-3
    )
    return before, float(np.sqrt(2 * best.cost))


def sensor_noise(rng, clean, level, kind, dt, reference):
    """Noise of one channel; level is relative to the reference rms."""
    sd = level * reference
    if kind == "growing":
        return sd * 0.2 * rng.standard_normal(clean.size) + 0.03 * np.abs(clean) * rng.standard_normal(clean.size)
    white = rng.standard_normal(clean.size)
    if kind == "coloured":
        out = np.empty_like(white)
        keep = 0.85
        state = white[0]
        for k, w in enumerate(white):
            state = keep * state + np.sqrt(1 - keep**2) * w
            out[k] = state
        return sd * out
    return sd * white


def write_record(path, kind, time, columns, name=None, comments=()):
    """CSV in the form of the interface; columns: name -> (unit, values)."""
    units = {k: u for k, (u, _) in columns.items()}
    with open(path, "w") as file:
        file.write(f"# name: {name or Path(path).stem}\n# kind: {kind}\n")
        for line in comments:
            file.write(f"# {line}\n")
        file.write("time [s]," + ",".join(f"{k} [{units[k]}]" for k in columns) + "\n")
        table = np.column_stack([v for _, v in columns.values()])
        for t, row in zip(time, table):
            file.write(f"{t:.6g}," + ",".join(f"{value:.7g}" for value in row) + "\n")


def units(dof):
    turn = dof in ("Roll", "Pitch", "Yaw")
    return ("rad", "rad/s", "rad/s^2", "N m") if turn else ("m", "m/s", "m/s^2", "N")


def write_label(folder, case, label):
    path = Path(folder) / "labels" / f"{case}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(label, indent=1, default=lambda v: v.tolist() if hasattr(v, "tolist") else str(v)))
