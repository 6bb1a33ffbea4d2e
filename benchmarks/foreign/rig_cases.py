"""Tests of a towing tank other than free motion: driven body, static test, decays under way.

python rig_cases.py BEM_FOLDER OUT_FOLDER. In a `prescribed` record <Dof>_force is the force of the drive on the body:
the external force f for which (M + A_inf) x'' + int K x' + C x = f + effects holds along the prescribed motion.
"""

import sys
import zlib
from pathlib import Path

import numpy as np
import special
import truth
from common import perturb, units, write_label, write_model, write_record

CASES = {  # body, dofs, kind, causes: (name, dof, share)
    "r01": ("box_m", "Heave", "prescribed", [("quadratic_drag", "Heave", 0.25)]),
    "r02": ("box_m", "Sway", "prescribed", [("quadratic_drag", "Sway", 0.35)]),
    "r03": ("shiproll_m", "Roll", "prescribed", [("quadratic_drag", "Roll", 0.06), ("added_inertia", "Roll", 0.12)]),
    "r04": ("sphere_m", "Heave", "prescribed", [("added_inertia", "Heave", 0.15)]),
    "r05": ("box_m", "Heave", "prescribed", []),
    "r06": ("shiproll_m", "Roll", "prescribed", []),
    "r07": ("shiproll_m", "Roll", "towed", [("quadratic_drag", "Roll", 0.02), ("lift_damping", "Roll", 0.03)]),
    "r08": ("barge_m", "Roll", "towed", [("lift_damping", "Roll", 0.025)]),
    "r09": ("shiproll_m", "Roll", "static", [("linear_stiffness", "Roll", 0.12)]),
    "r10": ("shiproll_m", "Roll", "static", [("cubic_stiffness", "Roll", -0.25)]),
    "r11": ("cyl_f", "Surge", "static", [("coulomb_friction", "Surge", 0.15)]),
    "r12": ("shiproll_m", "Roll", "static", []),
    "r13": ("barge_m", "Roll", "towed", []),
}
LIMITS = {"Heave": 0.05, "Sway": 0.06, "Roll": 0.15, "Surge": 3.0}


def driven(body, effects, dt, x, v, a):
    """Force of the drive along a prescribed motion that starts at rest."""
    span = 60.0 / body.omega[-1] * 3.2
    K = body.kernel(dt, span)
    memory = np.convolve(v, K[:, 0, 0])[: len(v)] * dt - 0.5 * dt * K[0, 0, 0] * v
    table = effects.table.copy()
    table[:, 0] += body.D
    f = np.array(
        [
            truth.effect_force(0.0, np.array([p]), np.array([q]), np.zeros((1, 4)), table, 0.0)[0][0]
            for p, q in zip(x, v)
        ]
    )
    inertia = (body.M + body.A_inf + effects.added_inertia)[0, 0]
    return inertia * a + memory + body.stiffness[0, 0] * x - f


def motion(rng, kind, w0, size, dt):
    """Prescribed motion with its exact derivatives: a ramped sine or a sum of sines."""
    if kind == "regular":
        omega, amplitude = np.array([w0 * rng.uniform(0.5, 1.5)]), np.array([size * rng.uniform(0.5, 1.0)])
    else:
        omega = w0 * np.sort(rng.uniform(0.35, 1.7, 12))
        amplitude = size * 0.45 * rng.uniform(0.3, 1.0, 12) / np.sqrt(3)
    phase = rng.uniform(0, 2 * np.pi, omega.size)
    t = np.arange(0, (18 if kind == "regular" else 40) * 2 * np.pi / w0, dt)
    length = 3 * 2 * np.pi / w0
    s = np.clip(t / length, 0, 1)
    r, dr = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3), 140 * s**3 * (1 - s) ** 3 / length
    ddr = 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s) / length**2
    angle = np.outer(t, omega) + phase
    x, v, a = np.cos(angle) @ amplitude, -np.sin(angle) @ (amplitude * omega), -np.cos(angle) @ (amplitude * omega**2)
    return t, r * x, dr * x + r * v, ddr * x + 2 * dr * v + r * a


def hidden(body, causes, size):
    effects, told = truth.Effects(1), []
    w0 = np.sqrt((body.stiffness / (body.M + body.A_inf))[0, 0])
    inertia, stiffness = (body.M + body.A_inf)[0, 0], body.stiffness[0, 0]
    for name, dof, s in causes:
        b = 2 * w0 * inertia
        values = {
            "quadratic_drag": dict(quadratic_drag=s * b / (0.85 * w0 * size)),
            "lift_damping": dict(lift_damping=s * b),
            "linear_stiffness": dict(linear_stiffness=s * stiffness),
            "cubic_stiffness": dict(cubic_stiffness=s * stiffness / size**2),
            "coulomb_friction": dict(coulomb_friction=s * stiffness * size, coulomb_speed=0.01 * w0 * size),
        }.get(name, {})
        effects.put(0, **values)
        if name == "added_inertia":
            effects.added_inertia[0, 0] = s * inertia
            values = {"inertia": s * inertia}
        told.append({"name": name, "dof": dof, "strength": s, "parameters": values})
    return effects, told


def static_test(rng, body, effects, size, friction):
    """Steps of an external force held until at rest: (force, position) pairs; dry friction lags the way it came."""
    k, p = body.stiffness[0, 0], effects.table[0]
    up = np.linspace(0, 1, 6)
    path = np.r_[up, up[-2::-1], -up[1:], -up[-2::-1]] * size * rng.uniform(0.85, 1.0)
    direction = np.r_[0, np.sign(np.diff(path))]
    force = (
        k * path
        + p[truth.C["linear_stiffness"]] * path
        + p[truth.C["cubic_stiffness"]] * path**3
        + friction * direction
    )
    hold = 12
    return np.repeat(path, hold), np.repeat(force, hold)


def make(case, bem, out):
    name, dof, kind, causes = CASES[case]
    rng = np.random.default_rng(zlib.crc32(case.encode()))
    body = truth.rig(special.body(name, bem, [dof]), 8.0 if dof == "Sway" else 60.0)
    w0 = np.sqrt((body.stiffness / (body.M + body.A_inf))[0, 0])
    pace = np.sqrt(9.81 / 0.25) if dof == "Sway" else w0
    size = LIMITS[dof]
    effects, told = hidden(body, causes, size)
    errors = {k: float(rng.uniform(-0.015, 0.015)) for k in ("mass", "stiffness", "A_inf", "kernel")}
    place = Path(out) / "cases" / case
    place.mkdir(parents=True, exist_ok=True)
    write_model(special.bem_file(name, bem), place / "model.nc", body, errors)
    dt, files, checks = 2 * np.pi / pace / 200, [], []
    nominal = perturb(body, errors)
    plans = {
        "prescribed": [("regular", 0)] * 5 + [("irregular", 0), ("regular*", 0), ("irregular*", 0)],
        "static": [("static", 0), ("static", 0), ("static*", 0)],
        "towed": [
            ("decay", 0.0),
            ("decay", 0.0),
            ("decay", 0.5),
            ("decay", 1.0),
            ("decay", 1.0),
            ("decay*", 0.0),
            ("decay*", 0.75),
        ],
    }[kind]
    for number, (word, speed) in enumerate(plans, 1):
        unseen, shape = word.endswith("*"), word.rstrip("*")
        file = f"{'unseen' if unseen else 'record'}_{shape}{number}.csv"
        unit = units(dof)
        if kind == "prescribed":
            t, x, v, a = motion(rng, shape, pace, size, dt)
            f, guess = driven(body, effects, dt, x, v, a), driven(nominal, truth.Effects(1), dt, x, v, a)
            checks.append(np.linalg.norm(f - guess) / np.linalg.norm(f))
            pick = slice(None, None, 4)
            columns = {
                dof: (unit[0], x[pick] + 0.002 * np.std(x) * rng.standard_normal(x[pick].size)),
                f"{dof}_force": (unit[3], f[pick] + 0.008 * np.std(f) * rng.standard_normal(x[pick].size)),
            }
            write_record(place / file, "prescribed", t[pick], columns)
        elif kind == "static":
            friction = effects.table[0, truth.C["coulomb_friction"]]
            x, f = static_test(rng, body, effects, size * (0.8 if unseen else 1.0), friction)
            checks.append(np.linalg.norm(x - f / nominal.stiffness[0, 0]) / np.linalg.norm(x))
            columns = {
                dof: (unit[0], x + 0.004 * np.std(x) * rng.standard_normal(x.size)),
                f"{dof}_force": (unit[3], f),
            }
            write_record(place / file, "static", np.arange(x.size) * 2.0, columns)
        else:
            x0 = np.array([size * rng.uniform(0.6, 1.2) * rng.choice([-1, 1])])
            step = 2 * np.pi / w0 / 150
            force = np.zeros((int(16 * 2 * np.pi / w0 / step), 1))
            x = truth.convolve(body, effects, step, force, x0, speed=speed)[0][:, 0]
            guess = truth.linear(nominal, step, force, x0)[:, 0]
            checks.append(np.linalg.norm(x - guess) / np.linalg.norm(x))
            pick = slice(None, None, 4)
            columns = {dof: (unit[0], x[pick] + 0.004 * np.std(x) * rng.standard_normal(x[pick].size))}
            write_record(place / file, "decay", np.arange(x.size)[pick] * step, columns, comments=[f"speed: {speed}"])
        files.append({"file": file, "kind": kind, "withheld": unseen, "speed": speed, "gap_nominal": float(checks[-1])})
    twins = {"lift_damping": ["linear_damping", "lift_damping"], "linear_damping": ["radiation_damping"]}
    write_label(
        out,
        case,
        {
            "id": case,
            "null": not told,
            "causes": told,
            "accept": [[c["name"], *twins.get(c["name"], [])] for c in told],
            "dofs": [dof],
            "body": name,
            "program": f"own {kind}",
            "records": files,
            "nominal_error": errors,
            "tolerance": 0.02,
        },
    )
    print(case, kind, name, dof, [c["name"] for c in told], "gap of the nominal model", np.round(checks, 3), flush=True)


def check(bem):
    """Driven sphere against the frequency domain: amplitude and phase of the force."""
    body = special.body("sphere_m", bem, ["Heave"])
    w = float(body.omega[18])
    dt = 2 * np.pi / w / 300
    t = np.arange(0, 25 * 2 * np.pi / w, dt)
    rise = truth.ramp(t, 4 * 2 * np.pi / w)
    x = rise * np.cos(w * t)
    v = np.gradient(x, dt)
    f = driven(body, truth.Effects(1), dt, x, v, np.gradient(v, dt))
    last = t > t[-1] - 5 * 2 * np.pi / w
    got = 2 / last.sum() * np.sum(f[last] * np.exp(-1j * w * t[last]))
    want = body.stiffness[0, 0] - w**2 * (body.M + body.A[18])[0, 0] + 1j * w * body.B[18, 0, 0]
    print("driven sphere: force against the frequency domain, relative error", np.round(abs(got / want - 1), 5))


if __name__ == "__main__":
    check(sys.argv[1])
    for one in sys.argv[3:] or CASES:
        make(one, sys.argv[1], sys.argv[2])
