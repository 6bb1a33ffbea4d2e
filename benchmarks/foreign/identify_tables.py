"""Cases for identify from others' BEM tables: raw kernels, Cummins' equation in time, seas of any shape.

python identify_tables.py BEM OUT SEEDS SALT; files as identify_cases.py writes them. The prior's damping is that of a
body of another size (odd seeds: K' = a K(s w), a and s random) or off smoothly (even seeds), both about 15 %.
"""

import sys
import zlib
from pathlib import Path

import numba
import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

G, RHO = 9.81, 1000.0
BODIES = {"ball": ("sphere_capytaine", 2), "drum": ("cylinder_capytaine", 2), "egg": ("bem_wecsim_ellipsoid", 2),
          "tanker": ("mss_tanker", 2), "fpso": ("mss_fpso", (2, 4))}
SEAS = ("jonswap", "swellwind", "flat", "lumpy")


def table(name):
    """omega, B, A_inf, M, C, X of a body; one table each, its noise smoothed away."""
    source, pick = BODIES[name]
    if source.endswith("capytaine"):
        d = xr.open_dataset(Path(BEM) / "formats" / f"{source}.nc")
        i = [[str(v).split("__")[-1].lower() for v in d.radiating_dof.values].index("heave")]
        w = d.omega.values
        ij = np.ix_(range(w.size), i, i)
        A, B = d.added_mass.values[ij], d.radiation_damping.values[ij]
        M, C = d.inertia_matrix.values[np.ix_(i, i)], d.hydrostatic_stiffness.values[np.ix_(i, i)]
        X = d.excitation_force.values[0][:, 0, i] + 1j * d.excitation_force.values[1][:, 0, i]
        good = np.isfinite(A + B).all(axis=(1, 2)) & np.isfinite(X).all(axis=1)
        w, A, B, X = w[good], A[good], B[good], X[good]
        A_inf = A[-40:].mean(axis=0)
    else:
        d = np.load(Path(BEM) / f"{source}.npz")
        i = np.atleast_1d(pick)
        w = d["w"]
        ij = np.ix_(range(w.size), i, i)
        A, B, A_inf = d["A"][ij], d["B"][ij], d["Ainf"][np.ix_(i, i)]
        if "MRB" in d:
            M, C = d["MRB"][np.ix_(i, i)], (d["C"] if "C" in d else np.zeros((6, 6)))[np.ix_(i, i)]
            if name == "tanker":
                C = 1025 * G * np.array([[d["MRB"][0, 0] / 1025 / 12.0 / 0.82]])  # block coefficient .82, draught 12 m
        else:
            A, B, A_inf = RHO * A, RHO * B, RHO * A_inf
            M, C = A_inf * 1.1, None
        X = None
    if w[0] == 0.0:
        w, A, B = w[1:], A[1:], B[1:]
        X = None if X is None else X[1:]
    B = np.maximum(B, 0.0) if B.shape[1] == 1 else B
    if X is None:
        size = np.sqrt(2 * RHO * G**3 / w[:, None] ** 3 * np.maximum(np.einsum("wii->wi", B), 0))
        X = size * np.exp(-0.05j * w[:, None] ** 2 / w.max() ** 2)
        if len(i) == 2:
            X[:, 1] *= 1j
    if C is None:
        peak = w[np.argmax(B[:, 0, 0])]
        C = (M + A_inf) * (1.25 * peak) ** 2
    return w, 0.5 * (B + np.swapaxes(B, 1, 2)), A_inf, M, 0.5 * (C + C.T), X


def kernel(w, B, dt, span):
    """K(t) on t = 0, dt, ...: cosine transform of B, w^-4 beyond the table, ended smoothly."""
    u = np.linspace(0.0, 3.0 * w[-1], 4000)
    spline = CubicSpline(np.r_[0.0, w], np.concatenate([0 * B[:1], B]))
    b = spline(np.minimum(u, w[-1])) * (np.maximum(u, w[-1]) / w[-1])[:, None, None] ** -4.0
    t = np.arange(int(span / dt) + 1) * dt
    weight = np.full(u.size, u[1])
    weight[[0, -1]] *= 0.5
    K = np.tensordot(2 / np.pi * np.cos(np.outer(t, u)) * weight, b, 1)
    return K * (0.5 + 0.5 * np.cos(np.pi * np.clip(t / span * 2 - 1, 0, 1)))[:, None, None]


def transform(K, dt, w, A_inf):
    t = np.arange(len(K)) * dt
    weight = np.full(t.size, dt)
    weight[[0, -1]] *= 0.5
    e = np.exp(-1j * np.outer(w, t)) * weight
    return np.tensordot(e, K, 1)


@numba.njit(cache=True)
def march(mass, C, K, dt, f):
    n, steps = f.shape[1], f.shape[0]
    x, v, a = np.zeros((steps, n)), np.zeros((steps, n)), np.zeros((steps, n))
    half = 0.5 * dt * K[0]
    lhs = np.linalg.inv(mass + 0.5 * dt * half + 0.25 * dt * dt * C)
    for k in range(1, steps):
        vp, xp = v[k - 1] + 0.5 * dt * a[k - 1], x[k - 1] + dt * v[k - 1] + 0.25 * dt * dt * a[k - 1]
        r = f[k] - C @ xp - half @ vp
        for j in range(1, min(len(K), k + 1)):
            for p in range(n):
                for q in range(n):
                    r[p] -= dt * K[j, p, q] * v[k - j, q]
        a[k] = lhs @ r
        v[k], x[k] = vp + 0.5 * dt * a[k], xp + 0.25 * dt * dt * a[k]
    return x


def jonswap(w, peak, gamma):
    r = np.exp(-0.5 * ((w / peak - 1) / np.where(w < peak, 0.07, 0.09)) ** 2)
    return (w / peak) ** -5.0 * np.exp(-1.25 * (w / peak) ** -4.0) * gamma**r


def sea(rng, kind, w, w0):
    if kind == "swellwind":
        s1 = jonswap(w, w0 * rng.uniform(0.45, 0.68), rng.uniform(3, 8))
        s2 = jonswap(w, w0 * rng.uniform(0.9, 1.3), rng.uniform(1, 3))
        share = rng.uniform(0.25, 0.7)
        s = share * s1 / np.trapezoid(s1, w) + (1 - share) * s2 / np.trapezoid(s2, w)
    elif kind == "flat":
        low, high = w0 * rng.uniform(0.45, 0.65), w0 * rng.uniform(1.5, 1.9)
        s = ((w > low) & (w < high)).astype(float)
    elif kind == "lumpy":
        peak, width = w0 * rng.uniform(0.65, 0.95), w0 * rng.uniform(0.06, 0.15)
        centres = np.arange(0, w[-1] + width, width)
        lumps = CubicSpline(centres, 0.6 * rng.standard_normal(centres.size))(w)
        s = np.where(w > peak, (w / peak) ** -4.0, np.exp(-9 * (1 - w / peak))) * np.exp(lumps)
    else:
        s = jonswap(w, w0 * rng.uniform(0.7, 1.15), rng.uniform(1, 5))
    return s / np.trapezoid(s, w)


def one(name, kind, length, seed, salt):
    case = f"{name}_{kind}_{length}_{seed:02d}"
    rng = np.random.default_rng([salt, zlib.crc32(case.encode())])
    w, B, A_inf, M, C, X = table(name)
    w0 = np.sqrt(np.diag(C) / np.diag(M + A_inf)).max()
    scale = 7.2 / w0
    dt = 0.0125 * scale
    span = min(30 * scale, 0.5 * 2 * np.pi / np.median(np.diff(w)))
    K = kernel(w, B, dt, span)
    true = transform(K, dt, w, A_inf)
    lead = 40 * scale
    nt = int((lead + length * scale) / dt)
    t = np.arange(nt) * dt
    edges = np.linspace(max(0.25 * w0, w[0]), min(2.6 * w0, w[-1]), int(5 * (length + 60)))
    o = edges[:-1] + rng.uniform(size=edges.size - 1) * np.diff(edges)
    S = sea(rng, "jonswap" if kind.startswith("known") else kind, o, w0)
    size = 0.003 * scale**2
    draws = rng.standard_normal(o.size) + 1j * rng.standard_normal(o.size)
    amp = size * np.sqrt(S * np.diff(edges)) * draws
    Xo = CubicSpline(w, X)(o)
    f = np.concatenate([np.real(np.exp(1j * np.outer(t[k:k + 3000], o)) @ (amp[:, None] * Xo))
                        for k in range(0, nt, 3000)])
    ramp = np.clip(t / (10 * scale), 0, 1)[:, None]
    heavier = 1.03 if kind == "known_mass3" else 1.0
    x = march(heavier * M + A_inf, C, K, dt, np.ascontiguousarray(f * ramp))
    pick = np.arange(int(lead / dt), nt, 2)
    dofs = ["Heave", "Pitch"][: len(M)]
    head, cols = ["time [s]"], [t[pick] - t[pick[0]]]
    for i, d in enumerate(dofs):
        head.append(f"{d} [{'rad' if d == 'Pitch' else 'm'}]")
        cols.append(x[pick, i] + 0.01 * x[pick, i].std() * rng.standard_normal(pick.size))
    if kind.startswith("known"):
        for i, d in enumerate(dofs):
            head.append(f"{d}_force [{'N m' if d == 'Pitch' else 'N'}]")
            cols.append(f[pick, i] + 0.01 * f[pick, i].std() * rng.standard_normal(pick.size))
    folder = OUT / "identify" / case
    folder.mkdir(parents=True, exist_ok=True)
    text = "# kind: " + ("forced" if kind.startswith("known") else "motion-only") + "\n" + ",".join(head) + "\n"
    rows = [",".join(f"{v:.9g}" for v in row) for row in np.array(cols).T]
    (folder / "record.csv").write_text(text + "\n".join(rows))
    error = prior(rng, folder / "model.nc", w, B, A_inf, M, C, X, dofs, dt, span, true, seed, w0)
    labels = OUT / "identify_labels"
    labels.mkdir(exist_ok=True)
    Bk, Ak = true.real, A_inf + true.imag / w[:, None, None]
    np.savez(labels / f"{case}.npz", omega=w, A=Ak, B=Bk, A_inf=A_inf, M=heavier * M, C=C,
             time=t[pick] - t[pick[0]], force=f[pick])
    return error


def prior(rng, path, w, B, A_inf, M, C, X, dofs, dt, span, true, seed, w0):
    base = CubicSpline(np.r_[0.0, w], np.concatenate([0 * B[:1], B]))
    weight = (w > 0.5 * w0) & (w < 1.8 * w0)
    while True:
        if seed % 2:
            a, s = np.exp(0.1 * rng.standard_normal()), np.exp(0.08 * rng.standard_normal())
            Bp = a * base(np.minimum(w * s, w[-1])) * (np.maximum(w * s, w[-1]) / w[-1])[:, None, None] ** -4.0
        else:
            knots = np.arange(0, w[-1] + 0.5 * w0, 0.5 * w0)
            half = np.exp(0.075 * CubicSpline(knots, rng.standard_normal((knots.size, len(M))))(w))
            Bp = half[:, :, None] * B * half[:, None, :]
        K = transform(kernel(w, Bp, dt, span), dt, w, A_inf)
        error = np.linalg.norm((K - true)[weight][:, 0, 0]) / np.linalg.norm(true[weight][:, 0, 0])
        if 0.08 < error < 0.25:
            break
    own, new = np.einsum("wii->wi", true.real), np.einsum("wii->wi", K.real)
    Xp = X * np.sqrt(np.maximum(new, 1e-9 * new.max(0)) / np.maximum(own, 1e-9 * own.max(0)))
    dims = ("omega", "influenced_dof", "radiating_dof")
    n = len(dofs)
    A = np.concatenate([A_inf + K.imag / w[:, None, None], A_inf[None]])
    X4 = np.concatenate([np.stack([Xp.real, -Xp.imag], 1), np.full((1, 2, n), np.nan)])[:, :, None, :]
    names = np.array(dofs, object)
    data = {"added_mass": (dims, A), "radiation_damping": (dims, np.concatenate([K.real, 0 * K.real[:1]])),
            "inertia_matrix": (dims[1:], M), "hydrostatic_stiffness": (dims[1:], C),
            "excitation_force": (("omega", "complex", "wave_direction", "influenced_dof"), X4)}
    coords = {"omega": np.r_[w, np.inf], "complex": ["re", "im"], "wave_direction": [0.0], "influenced_dof": names,
              "radiating_dof": names, "rho": RHO, "g": G, "water_depth": np.inf, "forward_speed": 0.0}
    xr.Dataset(data, coords=coords).to_netcdf(path)
    return error


if __name__ == "__main__":
    BEM, OUT = sys.argv[1], Path(sys.argv[2])
    salt = int(sys.argv[4])
    jobs = [(b, s, n) for s in SEAS for n in (30, 120) for b in ("egg", "tanker")]
    jobs += [(b, k, n) for b in ("ball", "drum") for k, n in (("jonswap", 120), ("swellwind", 120), ("lumpy", 120))]
    jobs += [("egg", "jonswap", 600), ("fpso", "jonswap", 120), ("egg", "known_clean", 30), ("ball", "known_mass3", 30)]
    for b, k, n in jobs:
        print(b, k, n, np.round([one(b, k, n, i, salt) for i in range(1, int(sys.argv[3]) + 1)], 2), flush=True)
