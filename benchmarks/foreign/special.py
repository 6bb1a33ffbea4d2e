"""Programs other than the two integrators of truth.py: MoorDyn lines, pressure on panels, WecOptTool."""

import os
import tempfile
from pathlib import Path

import numba
import numpy as np
import truth
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

GEOMETRY = {"flared_m": "cyl_m"}  # bodies that are one below the water and another above it
# MoorDyn: depth, fairlead radius and height, anchor radius, unstretched length, line mass per metre (kg/m), EA
LINES = {
    1: dict(depth=80.0, fair=8.0, height=-10.0, anchor=330.0, length=337.0, mass=70.0, diameter=0.105, EA=3.0e8),
    3: dict(depth=80.0, fair=8.0, height=-10.0, anchor=330.0, length=338.0, mass=9.0, diameter=0.04, EA=2.0e7),
}


def bem_file(name, bem):
    return Path(bem) / f"{GEOMETRY.get(name, name)}.nc"


def body(name, bem, dofs):
    return truth.consistent(truth.load(bem_file(name, bem), dofs))


def facts(name, program, dofs=1):
    if program != "moordyn":
        return {}
    offset, pull = static_curve(LINES[dofs])
    return {"lines": LINES[dofs], "static_curve": {"surge_m": offset, "force_N": pull}}


# --- time stepping with a force that is computed outside ------------------------------------------------------------


def march(body, effects, dt, force, x0, extra, corrections=2, memory_time=None):
    """Newmark's average acceleration; extra(k, t, x, v) is the force of the lines or of the pressure."""
    n = len(body.dofs)
    K = body.kernel(dt, memory_time or 60.0 / body.omega[-1] * 3.2)
    inverse = np.linalg.inv(body.M + body.A_inf + effects.added_inertia)
    table, z = effects.table.copy(), np.zeros((n, 4))
    table[:, 0] += body.D
    x, v, a = (np.zeros_like(force) for _ in range(3))
    x[0] = x0
    a[0] = inverse @ (force[0] + extra(0, 0.0, x[0], v[0]) - body.stiffness @ x[0])
    for k in range(1, len(force)):
        m = min(k, len(K) - 1)
        past = np.einsum("kij,kj->i", K[1 : m + 1], v[k - m : k][::-1]) if m else 0.0
        xk, vk, ak = x[k - 1] + dt * v[k - 1] + 0.5 * dt**2 * a[k - 1], v[k - 1] + dt * a[k - 1], a[k - 1]
        outside = extra(k, k * dt, xk, vk)
        for turn in range(max(corrections, 1) + 2):
            if 0 < turn <= corrections:
                outside = extra(k, k * dt, xk, vk)
            f = truth.effect_force(k * dt, xk, vk, z, table, 0.0)[0]
            ak = inverse @ (force[k] + outside + f - body.stiffness @ xk - dt * (past + 0.5 * K[0] @ vk))
            vk = v[k - 1] + 0.5 * dt * (a[k - 1] + ak)
            xk = x[k - 1] + dt * v[k - 1] + 0.25 * dt**2 * (a[k - 1] + ak)
        x[k], v[k], a[k] = xk, vk, ak
    return x, v, a


# --- MoorDyn --------------------------------------------------------------------------------------------------------


def line_file(p, headings=(180.0, 60.0, -60.0), segments=20):
    step = 0.5 * p["length"] / segments / np.sqrt(p["EA"] / p["mass"])
    rows = [
        "--------------------- MoorDyn Input File",
        "lines",
        "----------------------- LINE TYPES",
        "Name Diam MassDen EA BA/-zeta EI Cd Ca CdAx CaAx",
        "(-) (m) (kg/m) (N) (N-s/-) (-) (-) (-) (-) (-)",
        f"chain {p['diameter']} {p['mass']} {p['EA']:.4e} -0.8 0 1.6 1.0 0.1 0.0",
        "---------------------- POINTS",
        "ID Attachment X Y Z M V CdA CA",
        "(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)",
    ]
    for i, heading in enumerate(np.radians(headings)):
        rows.append(
            f"{i + 1} Fixed {p['anchor'] * np.cos(heading):.5f} {p['anchor'] * np.sin(heading):.5f} "
            f"{-p['depth']} 0 0 0 0"
        )
    for i, heading in enumerate(np.radians(headings)):
        rows.append(
            f"{i + 4} Coupled {p['fair'] * np.cos(heading):.5f} {p['fair'] * np.sin(heading):.5f} {p['height']} 0 0 0 0"
        )
    rows += [
        "---------------------- LINES",
        "ID LineType AttachA AttachB UnstrLen NumSegs Outputs",
        "(-) (-) (-) (-) (m) (-) (-)",
    ]
    rows += [f"{i + 1} chain {i + 1} {i + 4} {p['length']} {segments} -" for i in range(len(headings))]
    rows += [
        "---------------------- OPTIONS",
        f"{step:.5f} dtM",
        "3.0e6 kbot",
        f"{100 * p['mass'] / p['diameter']:.4g} cbot",
        "1025 WtrDnsty",
        f"{p['depth']} WtrDpth",
        "2.0 dtIC",
        "300 TmaxIC",
        "0.0002 threshIC",
        "4 CdScaleIC",
        "rk2 tScheme",
        "0 writeLog",
        "---------------------- need this line",
    ]
    return "\n".join(rows) + "\n"


class Lines:
    """Lines at fairleads that move with the body (surge, heave, pitch small angles about `pivot`)."""

    def __init__(self, p, dofs, pivot=0.0, headings=(180.0, 60.0, -60.0), segments=16):
        import moordyn

        self.moordyn, self.dofs = moordyn, dofs
        folder = tempfile.mkdtemp()
        path = os.path.join(folder, "lines.txt")
        Path(path).write_text(line_file(p, headings, segments))
        self.home = np.array(
            [[p["fair"] * np.cos(h), p["fair"] * np.sin(h), p["height"]] for h in np.radians(headings)]
        )
        self.arm = self.home - [0, 0, pivot]
        self.pivot = np.array([0, 0, pivot])
        self.index = [("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw").index(d) for d in dofs]
        self.system = moordyn.Create(path)
        moordyn.SetVerbosity(self.system, 4) if hasattr(moordyn, "SetVerbosity") else None
        self.time, self.neutral, self.last = 0.0, None, None

    def six(self, values):
        full = np.zeros(6)
        full[self.index] = values
        return full

    def places(self, x):
        """Fairleads, and their arms about the pivot after the rotation vector x[3:]."""
        full = self.six(x)
        arm = Rotation.from_rotvec(full[3:]).apply(self.arm)
        return self.pivot + full[:3] + arm, arm

    def start(self, x0):
        position = self.places(x0)[0].ravel()
        self.moordyn.Init(self.system, list(position), [0.0] * position.size)

    def force(self, t, x, v, dt):
        """Force at the end of a step of dt that begins at t, x with the speed v."""
        (before, _), (after, arm) = self.places(x), self.places(x + dt * v)
        f = self.moordyn.Step(self.system, list(before.ravel()), list(((after - before) / dt).ravel()), t, dt)
        f = np.asarray(f).reshape(-1, 3)
        return np.r_[f.sum(0), np.cross(arm, f).sum(0)][self.index]

    def close(self):
        self.moordyn.Close(self.system)


def moordyn(body, effects, run, force, name):
    p = LINES[len(body.dofs)]
    dt = run["dt"]
    rest = Lines(p, body.dofs, segments=16 if len(body.dofs) == 1 else 10)
    rest.start(np.zeros(len(body.dofs)))
    neutral = [rest.force(k * 0.5, np.zeros(len(body.dofs)), np.zeros(len(body.dofs)), 0.5) for k in range(60)][-1]
    rest.close()
    lines = Lines(p, body.dofs, segments=16 if len(body.dofs) == 1 else 10)
    lines.start(run["x0"])

    def extra(k, t, x, v):
        if k == 0:
            return np.zeros(len(body.dofs)) - neutral + lines.force(0.0, x, v, 1e-4)
        return lines.force(t - dt, x - dt * v, v, dt) - neutral

    x, v, a = march(body, effects, dt, force, run["x0"], extra, corrections=0)
    lines.close()
    return x, v, a


def catenary(p, reach):
    """Horizontal and vertical pull [N] of one elastic line, its lower part on the seabed (no friction) or lifted."""
    w = (p["mass"] - 1025.0 * np.pi / 4 * p["diameter"] ** 2) * 9.81
    L, EA, h = p["length"], p["EA"], p["depth"] + p["height"]

    def shape(H):
        def rise(V):
            lifted = min(V / w, L)
            Va = V - w * L if V > w * L else 0.0
            return H / w * (np.sqrt(1 + (V / H) ** 2) - np.sqrt(1 + (Va / H) ** 2)) + (V**2 - Va**2) / (
                2 * EA * w
            ), lifted

        V = brentq(lambda V: rise(V)[0] - h, 1e-3, 50 * w * L + H)
        Va = max(V - w * L, 0.0)
        lying = max(L - V / w, 0.0)
        span = lying + H / w * (np.arcsinh(V / H) - np.arcsinh(Va / H)) + H * L / EA
        return span, V

    H = brentq(lambda H: shape(H)[0] - reach, 1e2, 0.08 * EA)
    return H, shape(H)[1]


def static_curve(p, headings=(180.0, 60.0, -60.0), reach=12.0):
    offsets, pull = np.linspace(-reach, reach, 25), []
    for s in offsets:
        total = 0.0
        for h in np.radians(headings):
            d = np.array([p["anchor"] * np.cos(h), p["anchor"] * np.sin(h)]) - [
                s + p["fair"] * np.cos(h),
                p["fair"] * np.sin(h),
            ]
            total += catenary(p, np.hypot(*d))[0] * d[0] / np.hypot(*d)
        pull.append(total)
    return offsets.tolist(), pull


# --- pressure on the panels of the moving body ----------------------------------------------------------------------

PROFILES = {  # radius over height of a body of revolution, above and below the water [m]
    "sphere_m": lambda z: np.sqrt(np.maximum(0.25**2 - z**2, 0.0)),
    "cone_m": lambda z: 0.35 * np.maximum(1 + z / 0.40, 0.0),
    "cyl_m": lambda z: 0.3 + 0 * z,
    "flared_m": lambda z: 0.3 + np.tan(np.radians(12.0)) * np.maximum(z, 0.0),
}
SPAN = {"sphere_m": (-0.25, 0.25), "cone_m": (-0.40, 0.30), "cyl_m": (-0.35, 0.25), "flared_m": (-0.35, 0.25)}


def rings(name, n=26, around=4):
    """Panels of half the body: x, z of the centres and their area times the vertical part of the inward normal."""
    low, high = SPAN[name]
    z = np.unique(np.r_[np.linspace(low, high, n), np.linspace(-0.1, 0.1, n)])
    r = PROFILES[name](z)
    angle = (np.arange(around) + 0.5) * np.pi / around
    zc = 0.5 * (z[1:] + z[:-1])
    flat = (
        np.pi * (r[1:] ** 2 - r[:-1] ** 2) / around
    )  # projected on the horizontal, both halves, upwards where it widens
    rc = 0.5 * (r[1:] + r[:-1])
    x = (rc[:, None] * np.cos(angle)).ravel()
    zs, up = np.repeat(zc, around), np.repeat(flat, around)
    if r[0] > 0:
        share = np.sqrt((np.arange(6) + 0.5) / 6) * r[0]
        x = np.r_[x, (share[:, None] * np.cos(angle)).ravel()]
        zs, up = np.r_[zs, np.full(6 * around, low)], np.r_[up, np.full(6 * around, np.pi * r[0] ** 2 / 6 / around)]
    return x, zs, up


@numba.njit(cache=True)
def pressure_force(heave, t, x, z, up, amplitude, omega, phase, moved):
    """Vertical force of hydrostatic and undisturbed wave pressure; moved = 0: mean wet surface, wave part only."""
    total = 0.0
    for j in range(x.size):
        height = z[j] + heave * moved
        if moved == 0.0 and height > 0.0:
            continue
        head = -height * moved
        for m in range(omega.size):
            k = omega[m] ** 2 / 9.81
            head += amplitude[m] * np.exp(k * min(height, 0.0)) * np.cos(omega[m] * t + phase[m] - k * x[j])
        if moved == 0.0 or head > 0.0:
            total += head * up[j]
    return 9810.0 * total


def panels(body, effects, run, force, name):
    x, z, up = rings(name)
    none = np.zeros(0)
    fine = (
        -(
            pressure_force(1e-3, 0.0, x, z, up, none, none, none, 1.0)
            - pressure_force(-1e-3, 0.0, x, z, up, none, none, none, 1.0)
        )
        / 2e-3
    )
    scale, weight = body.stiffness[0, 0] / fine, pressure_force(0.0, 0.0, x, z, up, none, none, none, 1.0)
    omega, amplitude, phase = run.get("waves", (none, none, none))
    rise = truth.ramp(np.arange(len(force)) * run["dt"], 4 * run.get("period", 1.0))

    def extra(k, t, position, velocity):
        a = amplitude * rise[k]
        moving = pressure_force(position[0], t, x, z, up, a, omega, phase, 1.0) - weight
        return np.array(
            [
                scale * (moving - pressure_force(0.0, t, x, z, up, a, omega, phase, 0.0))
                + body.stiffness[0, 0] * position[0]
            ]
        )

    return march(body, effects, run["dt"], force, run["x0"], extra, corrections=1)


PROGRAMS = {}  # compiled residuals of WecOptTool, one for each body and base frequency


# --- WecOptTool -----------------------------------------------------------------------------------------------------


def wec_dataset(body, omega):
    """A Capytaine-like dataset on the harmonics that WecOptTool asks for, consistent with the kernel."""
    import xarray as xr

    dt = 2 * np.pi / omega[-1] / 24
    span = 60.0 / body.omega[-1] * 3.2
    K = body.kernel(dt, span)
    t = np.arange(len(K)) * dt
    weight = np.full(t.size, dt)
    weight[[0, -1]] *= 0.5
    A = np.stack([body.A_inf - np.tensordot(weight * np.sin(w * t), K, 1) / w for w in omega])
    B = np.stack([np.tensordot(weight * np.cos(w * t), K, 1) for w in omega])
    inside = (omega >= body.omega[0]) & (omega <= body.omega[-1])
    X = np.stack([CubicSpline(body.omega, column)(omega) * inside for column in body.X.T], 1)[:, None, :]
    names = list(body.dofs)
    dims = ("omega", "influenced_dof", "radiating_dof")
    return xr.Dataset(
        {
            "added_mass": (dims, A),
            "radiation_damping": (dims, B),
            "inertia_matrix": (dims[1:], body.M),
            "hydrostatic_stiffness": (dims[1:], body.stiffness),
            "Froude_Krylov_force": (("omega", "wave_direction", "influenced_dof"), X),
            "diffraction_force": (("omega", "wave_direction", "influenced_dof"), np.zeros_like(X)),
        },
        coords={
            "omega": omega,
            "wave_direction": [0.0],
            "influenced_dof": names,
            "radiating_dof": names,
            "freq": ("omega", omega / 2 / np.pi),
            "rho": 1000.0,
            "g": 9.81,
            "water_depth": np.inf,
        },
    )


def wecopttool(body, effects, run, force, name):
    import logging
    import warnings

    warnings.simplefilter("ignore")
    import jax
    import jax.numpy as jnp
    import wecopttool as wot

    logging.disable(logging.WARNING)
    f1, nfreq, n = run["f1"], 96, len(body.dofs)
    key = (name, body.dofs, round(f1, 9))
    if key not in PROGRAMS:
        data = wec_dataset(body, 2 * np.pi * f1 * np.arange(1, nfreq + 1))
        width = n * len(truth.COLUMNS)

        def hidden(wec, x_wec, x_opt, wave):
            table, known = x_opt[:width].reshape(n, -1), x_opt[width:].reshape(-1, n)
            position = wec.vec_to_dofmat(x_wec)
            x, v = jnp.dot(wec.time_mat, position), jnp.dot(wec.time_mat, jnp.dot(wec.derivative_mat, position))
            effect = (
                table[:, 0] * v
                + table[:, 1] * jnp.abs(v) * v
                + table[:, 4] * x
                + table[:, 5] * x**2
                + table[:, 6] * x**3
            )
            return known - effect

        wec = wot.WEC.from_bem(data, f_add={"hidden": hidden}, friction=np.zeros((n, n)), min_damping=0.0)
        still = wot.waves.elevation_fd(
            f1, nfreq, 0.0, 1, amplitudes=np.zeros((nfreq, 1)), phases=np.zeros((nfreq, 1, 1))
        )
        still = still.squeeze("realization")
        residual = jax.jit(lambda x, given: wec.residual(x, given, still))
        PROGRAMS[key] = wec, residual, jax.jit(jax.jacobian(residual))
    wec, residual, jacobian = PROGRAMS[key]
    table = effects.table.copy()
    table[:, 0] += body.D
    w, a, p = run["waves"]
    given = jnp.asarray(np.r_[table.ravel(), truth.excitation(body, w, a, p, np.asarray(wec.time))[1].ravel()])
    x = jnp.zeros(wec.nstate_wec)
    for _ in range(30):
        r = residual(x, given)
        x = x - jnp.linalg.solve(jacobian(x, given), r)
        if jnp.max(jnp.abs(r)) < 1e-8 * np.max(np.abs(force)):
            break
    else:
        raise RuntimeError(f"WecOptTool's residual is {float(jnp.max(jnp.abs(r)))} N after 30 Newton steps")
    modes = np.asarray(wec.vec_to_dofmat(x))
    steps = len(force)
    t = np.arange(steps) * run["dt"]
    k = np.arange(1, nfreq + 1)
    c = np.zeros((nfreq + 1, n), complex)
    c[0] = modes[0]
    c[1:-1] = modes[1:-1:2] + 1j * modes[2:-1:2]
    c[-1] = modes[-1]
    jw = 1j * 2 * np.pi * f1 * np.r_[0, k]
    turn = np.exp(np.outer(t, jw))
    return tuple((turn @ (c * (jw**q)[:, None])).real for q in range(3))
