"""Sixty cases with a hidden cause (or none), by simulators that share nothing with radiation_ss.

python cases.py BEM_FOLDER OUT_FOLDER [case ...]. Each case has its own seed; the label says all true numbers.
Case folder: model.nc (nominal), record_*.csv, unseen*.csv (withheld). Labels lie beside the case folders, not in them.
"""

import sys
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import special
import truth
from common import gaps, pooled, predict, sensor_noise, units, write_label, write_model, write_record

TOLERANCE = 0.02
INPUT_CAUSES = ("excitation_gain", "excitation_delay", "sensor_delay", "sensor_gain", "slow_drift", "constant_force")
TWINS = {
    "sensor_gain": ["excitation_gain"],
    "sensor_delay": ["excitation_delay"],
    "excitation_gain": ["sensor_gain"],
    "excitation_delay": ["sensor_delay"],
    "constant_force": ["sensor_bias"],
    "slow_drift": [],
    "nonlinear_hydrostatics": ["quadratic_stiffness", "cubic_stiffness", "parametric_stiffness"],
    "mooring_lines": ["linear_stiffness", "cubic_stiffness", "quadratic_stiffness", "catenary"],
    "power_takeoff_lag": ["linear_damping", "delayed_feedback"],
    "power_takeoff": ["linear_damping"],
    "linear_damping": ["radiation_damping"],
    "slack_mooring": [],
    "tank_resonance": ["radiation_damping"],
}

# id: body, dofs, program, causes (name, dof), records, options
SPECS = [
    ("c01", "sphere_m", "Heave", "convolve", [("quadratic_drag", "Heave")], "decay decay waves waves*", ""),
    ("c02", "sphere_m", "Heave", "convolve", [("linear_damping", "Heave")], "decay waves waves*", ""),
    ("c03", "barge_m", "Heave", "convolve", [("coulomb_friction", "Heave")], "decay decay decay* waves waves*", ""),
    ("c04", "barge_m", "Roll", "convolve", [("quadratic_drag", "Roll")], "decay decay decay*", "decays"),
    (
        "c05",
        "barge_m",
        "Heave Roll",
        "convolve",
        [("quadratic_drag", "Roll")],
        "decay decay waves waves decay* waves*",
        "",
    ),
    ("c06", "cone_m", "Heave", "convolve", [("linear_stiffness", "Heave")], "decay waves waves*", ""),
    ("c07", "box_m", "Heave Roll", "convolve", [("linear_stiffness", "Roll")], "decay waves waves*", "elevation"),
    ("c08", "cyl_m", "Heave", "convolve", [("cubic_stiffness", "Heave")], "decay decay waves waves*", "growing"),
    ("c09", "shiproll_m", "Roll", "prony", [("cubic_stiffness", "Roll")], "decay decay decay*", "decays"),
    (
        "c10",
        "shiproll_m",
        "Roll",
        "convolve",
        [("quadratic_drag", "Roll"), ("cubic_stiffness", "Roll")],
        "decay decay waves decay* waves*",
        "",
    ),
    (
        "c11",
        "ship_m",
        "Heave Pitch",
        "convolve",
        [("quadratic_stiffness", "Heave")],
        "decay decay waves waves decay* waves*",
        "",
    ),
    ("c12", "ship_m", "Heave Pitch", "prony", [("linear_damping", "Pitch")], "waves waves waves*", ""),
    ("c13", "cyl_f", "Surge", "convolve", [("slack_mooring", "Surge")], "decay decay waves waves*", ""),
    ("c14", "cyl_m", "Heave", "convolve", [("hysteresis", "Heave")], "decay decay waves waves*", ""),
    ("c15", "barge_f", "Heave Pitch", "convolve", [("added_inertia", "Heave")], "decay waves waves*", ""),
    ("c16", "cone_m", "Heave", "prony", [("added_inertia", "Heave")], "decay decay waves waves*", "coloured"),
    ("c17", "sphere_f", "Heave", "convolve", [("excitation_gain", "Heave")], "decay waves waves*", ""),
    ("c18", "barge_f", "Heave", "convolve", [("excitation_delay", "Heave")], "decay waves waves*", ""),
    ("c19", "cyl_m", "Heave", "convolve", [("sensor_delay", "Heave")], "decay waves waves*", "acceleration"),
    ("c20", "sphere_m", "Heave", "prony", [("sensor_gain", "Heave")], "decay waves waves*", "acceleration"),
    ("c21", "box_m", "Heave", "convolve", [("tank_resonance", "Heave")], "decay waves waves waves*", ""),
    ("c22", "box_m", "Sway Heave Roll", "convolve", [("slow_drift", "Sway")], "decay waves waves waves*", ""),
    ("c23", "ship_f", "Roll", "convolve", [("constant_force", "Roll")], "waves waves waves*", "elevation"),
    ("c24", "float_f", "Heave", "prony", [("power_takeoff_lag", "Heave")], "decay waves waves*", ""),
    ("c25", "float_f", "Heave Pitch", "convolve", [("power_takeoff", "Heave")], "waves waves waves*", "elevation"),
    (
        "c26",
        "ship_f",
        "Heave Roll",
        "convolve",
        [("quadratic_drag", "Roll"), ("linear_damping", "Heave")],
        "decay waves waves*",
        "",
    ),
    (
        "c27",
        "box_m",
        "Sway Heave Roll",
        "convolve",
        [("quadratic_drag", "Sway"), ("quadratic_drag", "Roll"), ("linear_stiffness", "Sway")],
        "decay decay waves waves waves*",
        "",
    ),
    ("c28", "cyl_f", "Surge Heave Pitch", "prony", [("linear_stiffness", "Surge")], "decay waves waves*", ""),
    (
        "c29",
        "cone_m",
        "Heave",
        "convolve",
        [("coulomb_friction", "Heave"), ("added_inertia", "Heave")],
        "decay decay waves waves*",
        "jitter",
    ),
    (
        "c30",
        "sphere_m",
        "Heave",
        "convolve",
        [("quadratic_drag", "Heave")],
        "regular regular regular regular* decay",
        "",
    ),
    ("c31", "sphere_f", "Heave", "wecopttool", [("quadratic_drag", "Heave")], "waves waves waves*", "steady"),
    ("c32", "cone_m", "Heave", "wecopttool", [("cubic_stiffness", "Heave")], "waves waves waves*", "steady"),
    ("c33", "float_f", "Heave", "wecopttool", [("linear_damping", "Heave")], "waves waves waves*", "steady"),
    ("c34", "barge_f", "Heave Pitch", "wecopttool", [("linear_stiffness", "Pitch")], "waves waves waves*", "steady"),
    ("c35", "cyl_f", "Surge Heave Pitch", "moordyn", [("mooring_lines", "Surge")], "decay decay waves waves*", ""),
    ("c36", "cyl_f", "Surge", "moordyn", [("mooring_lines", "Surge")], "decay decay decay*", "decays"),
    (
        "c37",
        "cyl_f",
        "Surge Heave Pitch",
        "moordyn",
        [("mooring_lines", "Surge"), ("quadratic_drag", "Surge")],
        "decay decay waves waves*",
        "",
    ),
    (
        "c38",
        "sphere_m",
        "Heave",
        "panels",
        [("nonlinear_hydrostatics", "Heave")],
        "decay decay decay* waves waves*",
        "large",
    ),
    ("c39", "cone_m", "Heave", "panels", [("nonlinear_hydrostatics", "Heave")], "decay decay waves waves*", "large"),
    (
        "c40",
        "flared_m",
        "Heave",
        "panels",
        [("nonlinear_hydrostatics", "Heave"), ("quadratic_drag", "Heave")],
        "decay decay waves waves*",
        "middle",
    ),
    ("n01", "sphere_m", "Heave", "convolve", [], "decay decay waves waves*", ""),
    ("n02", "barge_m", "Heave Roll", "convolve", [], "decay waves waves*", ""),
    ("n03", "box_m", "Sway Heave Roll", "convolve", [], "decay waves waves*", ""),
    ("n04", "cyl_f", "Surge Heave Pitch", "convolve", [], "decay waves waves*", "coloured"),
    ("n05", "ship_m", "Heave Pitch", "prony", [], "waves waves waves*", ""),
    ("n06", "shiproll_m", "Roll", "prony", [], "decay decay decay*", "decays"),
    ("n07", "float_f", "Heave", "wecopttool", [], "waves waves waves*", "steady"),
    ("n08", "sphere_f", "Heave", "wecopttool", [], "waves waves waves*", "steady elevation"),
    ("n09", "cone_m", "Heave", "convolve", [], "decay waves waves*", "growing"),
    ("n10", "ship_f", "Heave Roll", "convolve", [], "decay waves waves*", "elevation"),
    ("n11", "cyl_m", "Heave Pitch", "convolve", [], "decay regular regular regular*", "jitter"),
    ("n12", "barge_f", "Heave Pitch", "prony", [], "waves waves waves*", "growing"),
    ("n13", "cyl_m", "Heave", "panels", [], "decay waves waves*", ""),
    ("n14", "box_m", "Heave Roll", "convolve", [], "decay decay waves waves*", "acceleration"),
    ("n15", "sphere_m", "Heave", "convolve", [], "decay waves waves*", "wide"),
    ("n16", "barge_m", "Heave Roll", "convolve", [], "decay waves waves*", "wide"),
    ("n17", "cyl_m", "Heave", "prony", [], "decay decay decay* waves", "wide"),
    ("n18", "ship_m", "Heave Pitch", "convolve", [], "decay waves waves*", "wide"),
    ("n19", "float_f", "Heave Pitch", "wecopttool", [], "waves waves waves*", "wide steady"),
    ("n20", "cone_m", "Heave", "prony", [], "decay waves waves*", "wide jitter"),
    ("n21", "shiproll_m", "Roll", "convolve", [], "decay decay waves decay*", "wide"),
]


def natural(body):
    return np.sqrt(np.diag(body.stiffness) / np.diag(body.M + body.A_inf))


def amplitudes(body, options):
    """Motion that counts as large, for each degree of freedom: a share of the draught's length scale, or an angle."""
    size = np.cbrt(body.M[0, 0] / 1000.0) if body.dofs[0] in ("Surge", "Sway", "Heave") else 0.6
    heave = (0.38 if "large" in options else 0.17 if "middle" in options else 0.07) * size
    return np.array([{"Surge": 0.20 * size, "Sway": 0.20 * size, "Heave": heave}.get(d, 0.12) for d in body.dofs])


def plan(rng, body, records, options, focus):
    """Runs without their motion: time step, force, elevation, start, how much is cut from the front."""
    w0 = natural(body)
    main = w0[focus]
    fast = w0.max()
    dt = 2 * np.pi / fast / 150
    every = int(rng.choice([3, 4, 6]))
    large = amplitudes(body, options)
    runs, small = [], True
    for word in records.split():
        kind, unseen = word.rstrip("*"), word.endswith("*")
        run = {"kind": kind, "unseen": unseen, "dt": dt, "every": every, "x0": np.zeros(len(w0)), "cut": 0}
        if kind == "decay":
            cycles = (6, 9) if "moordyn" in options and len(w0) > 1 else (14, 26)
            steps = int(rng.uniform(*cycles) * 2 * np.pi / main / dt)
            size = 0.45 if small else 1.3
            run["x0"][focus] = (0.9 if unseen else size) * large[focus] * rng.uniform(0.9, 1.1) * rng.choice([-1, 1])
            small = False
            run["eta"], run["force"] = np.zeros(steps), np.zeros((steps, len(w0)))
        else:
            period = 2 * np.pi / main if main > 0.4 * fast else 2 * np.pi / fast
            duration = rng.uniform(45, 85) * 2 * np.pi / fast
            if main < 0.4 * fast:
                duration *= 0.9 if "moordyn" in options else 1.5
            lead = rng.choice([0.0, 25.0]) * period
            if "wecopttool" in options:
                f1 = 1 / (32 * period)
                count = np.arange(14, 60)
                omega = 2 * np.pi * f1 * count
                amplitude = np.sqrt(2 * truth.jonswap(omega, 1.0, period * rng.uniform(0.9, 1.3)) * 2 * np.pi * f1)
                phase = rng.uniform(0, 2 * np.pi, omega.size)
                dt = run["dt"] = 1 / f1 / 4096
                run["every"] = int(np.ceil(every * 2 * np.pi / fast / 150 / dt))
                run["f1"], run["count"], lead, duration = f1, count, 1 / f1, 1.6 / f1
            elif kind == "regular":
                omega = np.array([rng.uniform(0.7, 1.35) * 2 * np.pi / period])
                amplitude, phase = np.ones(1), np.zeros(1)
                duration, lead = 30 * period, 0.0
            else:
                omega, amplitude, phase = truth.irregular(
                    rng,
                    1.0,
                    period * rng.uniform(0.85, 1.45),
                    rng.choice([1.0, 2.0, 3.3, 5.0]),
                    20 if "panels" in options else 180,
                )
            keep = (omega > body.omega[0]) & (omega < body.omega[-1])
            omega, amplitude, phase = omega[keep], amplitude[keep], phase[keep]
            t = np.arange(int((lead + duration) / dt)) * dt
            eta, force = truth.excitation(body, omega, amplitude, phase, t)
            if "wecopttool" not in options:
                rise = truth.ramp(t, 4 * period)
                eta, force = eta * rise, force * rise[:, None]
            x = truth.linear(replace(body, D=body.D + 0.1 * w0 * np.diag(body.M + body.A_inf)), dt, force)
            scale = rng.uniform(0.45, 0.75) * np.min(large / (np.std(x, 0) + 1e-12))
            scale = min(scale, 0.05 * 2 * np.pi * 9.81 / omega[np.argmax(amplitude)] ** 2 / (4 * np.std(eta)))
            run.update(
                eta=eta * scale,
                force=force * scale,
                cut=int(lead / dt),
                waves=(omega, amplitude * scale, phase),
                period=period,
            )
        runs.append(run)
    return runs


def put_causes(rng, body, causes, strength, large, shape):
    """Effects of the given strengths (about a share of the restoring or inertia force), and their true numbers."""
    heavy = {"linear_stiffness": 6.0, "added_inertia": 6.0, "coulomb_friction": 4.0, "cubic_stiffness": 5.0}
    effects = truth.Effects(len(body.dofs))
    told = []
    w0 = natural(body)
    for (name, dof), s in zip(causes, strength):
        s *= heavy.get(name, 1.0) if len(causes) > 1 else 1.0
        i = body.dofs.index(dof)
        inertia, stiffness, a = (body.M + body.A_inf)[i, i], body.stiffness[i, i], large[i]
        b = 2 * w0[i] * inertia
        kind = shape.get(name, {})
        values = {
            "linear_damping": dict(linear_damping=s * b),
            "quadratic_drag": dict(quadratic_drag=s * b / (0.6 * w0[i] * a)),
            "coulomb_friction": dict(coulomb_friction=s * stiffness * a, coulomb_speed=0.02 * w0[i] * a),
            "linear_stiffness": dict(linear_stiffness=s * stiffness),
            "quadratic_stiffness": dict(quadratic_stiffness=s * stiffness / a),
            "cubic_stiffness": dict(cubic_stiffness=kind.get("sign", 1) * s * stiffness / a**2),
            "slack_mooring": dict(line_stiffness=s * stiffness, line_slack=0.3 * a, line_both=0.0),
            "hysteresis": dict(bw_stiffness=s * stiffness, bw_beta=0.7 / (0.3 * a), bw_gamma=0.3 / (0.3 * a)),
            "tank_resonance": dict(
                tank_gain=s * b * 2 * 0.015 * kind.get("ratio", 1.1) * w0[i],
                tank_omega=kind.get("ratio", 1.1) * w0[i],
                tank_zeta=0.015,
            ),
            "power_takeoff": dict(linear_damping=s * b),
            "power_takeoff_lag": dict(pto_damping=s * b, pto_lag=0.35 / w0[i]),
            "constant_force": dict(constant_force=s * stiffness * a),
        }.get(name, {})
        effects.put(i, **values)
        if name == "added_inertia":
            effects.added_inertia[i, i] = s * inertia
            values = {"inertia": s * inertia}
        if name in ("excitation_gain", "sensor_gain"):
            values = {"gain": 1 + s}
        if name in ("excitation_delay", "sensor_delay"):
            values = {"delay": s / w0[i]}
        if name == "slow_drift":
            values = {"force_per_elevation_squared": s * stiffness * a}
        effects.extra[name] = (i, values)
        told.append({"name": name, "dof": dof, "strength": float(s), "parameters": values})
    return effects, told


def shift(signal, delay, dt):
    t = np.arange(signal.shape[0]) * dt
    return np.stack([np.interp(t - delay, t, column) for column in signal.T], 1)


def run_truth(program, body, effects, run, name):
    """True motion of one run, and what its displacement sensor shows (without noise)."""
    dt, force = run["dt"], run["force"].copy()
    extra = effects.extra
    if "excitation_gain" in extra:
        force[:, extra["excitation_gain"][0]] *= extra["excitation_gain"][1]["gain"]
    if "excitation_delay" in extra:
        i, p = extra["excitation_delay"]
        force[:, i] = shift(force, p["delay"], dt)[:, i]
    if "slow_drift" in extra and run["kind"] != "decay":
        i, p = extra["slow_drift"]
        width = int(2.5 * run["period"] / dt)
        envelope = np.convolve(run["eta"] ** 2, np.hanning(width) / np.hanning(width).sum(), "same") / np.var(
            run["eta"]
        )
        force[:, i] += p["force_per_elevation_squared"] * envelope
    if program == "convolve":
        x, v, a = truth.convolve(body, effects, dt, force, run["x0"])
    elif program == "prony":
        x, v, a, run["prony_error"] = truth.prony(body, effects, dt, force, run["x0"])
    else:
        x, v, a = getattr(special, program)(body, effects, run, force, name)
    shown = x.copy()
    if "sensor_gain" in extra:
        i, p = extra["sensor_gain"]
        shown[:, i] *= p["gain"]
    if "sensor_delay" in extra:
        i, p = extra["sensor_delay"]
        shown[:, i] = shift(shown, p["delay"], dt)[:, i]
    run.update(x=x, v=v, a=a, shown=shown)


def solve_case(spec, bem):
    """Runs with their motion; the strength is searched until the retuned gap is what was drawn."""
    name, body_name, dofs, program, causes, records, options = spec
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    options = options + " " + program
    body = special.body(body_name, bem, dofs.split())
    spring = 9.0 * 2 * np.pi / natural(body)[np.isfinite(natural(body))].max()
    body = truth.rig(body, spring if len(body.dofs) > 1 else 6.0 * np.sqrt(np.cbrt(body.M[0, 0] / 1e3)))
    size = 0.06 if "wide" in options else 0.02
    errors = {key: float(rng.uniform(-size, size)) for key in ("mass", "stiffness", "A_inf", "kernel")}
    if "wide" in options:
        errors["stiffness"] = float(np.sign(errors["stiffness"]) * rng.uniform(0.04, 0.06))
    focus = body.dofs.index(causes[0][1]) if causes else int(rng.integers(len(body.dofs)))
    shape = {
        "cubic_stiffness": {"sign": -1 if body_name == "shiproll_m" else 1},
        "tank_resonance": {"ratio": float(rng.uniform(0.85, 1.2))},
    }
    runs = plan(rng, body, records, options, focus)
    large = amplitudes(body, options)
    target = float(np.exp(rng.uniform(np.log(0.11), np.log(0.34))))
    if causes and causes[0][0].endswith(("_gain", "_delay")):
        target = 0.5 * target + 0.05
    mix = rng.uniform(0.7, 1.3, len(causes))
    s = 0.06
    told, trace = [], []
    fixed = not causes or program in ("moordyn", "panels")
    for attempt in range(1 if fixed else 9):
        effects, told = put_causes(rng, body, causes, s * mix, large, shape)
        for run in runs:
            run_truth(program, body, effects, run, body_name)
        before, after = gaps(body, errors, runs, TOLERANCE)
        trace.append((s, after))
        if fixed or abs(np.log(after / target)) < 0.2:
            break
        s *= float(np.clip(target / after, 0.3, 3.0)) ** (0.9 if attempt < 4 else 0.5)
    if len(causes) > 1 and not fixed:
        for k, one in enumerate(told):
            only, _ = put_causes(rng, body, causes, s * mix * (np.arange(len(causes)) == k), large, shape)
            trial = [dict(run) for run in runs]
            for run in trial:
                run_truth(program, body, only, run, body_name)
            one["gap_alone"] = gaps(body, {}, trial, TOLERANCE)[1]
    unseen = [r for r in runs if r["unseen"]]
    pairs = list(
        zip(
            [r["shown"][r["cut"] :] for r in unseen],
            predict(
                body,
                errors,
                unseen,
                {round(unseen[0]["dt"], 12): body.kernel(unseen[0]["dt"], 60.0 / body.omega[-1] * 3.2)},
            ),
        )
    )
    facts = {"gap_nominal": before, "gap_retuned": after, "gap_unseen_nominal": pooled(pairs), "search": trace}
    return rng, body, errors, runs, told, facts


def write_case(spec, bem, out):
    name, body_name, _, program, _, _, options = spec
    rng, body, errors, runs, told, facts = solve_case(spec, bem)
    folder = Path(out) / "cases" / name
    folder.mkdir(parents=True, exist_ok=True)
    write_model(special.bem_file(body_name, bem), folder / "model.nc", body, errors)
    small = [c for c in told if c.get("gap_alone", 1.0) < 0.04]  # too weak to be asked for
    told = [c for c in told if c not in small]
    noise = next((k for k in ("growing", "coloured", "jitter") if k in options), "white")
    level = float(np.exp(rng.uniform(np.log(0.002), np.log(0.02))))
    reference = np.max([np.std(r["shown"], 0) for r in runs], 0)
    counts, files = {}, []
    for run in runs:
        key = ("unseen_" if run["unseen"] else "record_") + run["kind"]
        counts[key] = counts.get(key, 0) + 1
        file = f"{key}{counts[key]}.csv"
        write_run(rng, folder / file, body, run, noise, level, reference, options)
        files.append(
            {
                "file": file,
                "kind": run["kind"],
                "withheld": run["unseen"],
                "starts_at_rest": run["cut"] == 0 and program != "wecopttool",
            }
        )
    label = {
        "id": name,
        "null": not told,
        "causes": told,
        "too_weak_to_matter": small,
        "accept": [[c["name"], *TWINS.get(c["name"], [])] for c in told],
        "dofs": list(body.dofs),
        "body": body_name,
        "program": program,
        "options": options.split(),
        "records": files,
        "nominal_error": errors,
        "tolerance": TOLERANCE,
        "sensor": {"kind": noise, "level": level},
        **facts,
        "columns": list(truth.COLUMNS),
    }
    label.update(special.facts(body_name, program, len(body.dofs)))
    write_label(out, name, label)
    gap = " ".join(f"{word} {facts[key]:.3f}" for word, key in (
        ("nominal", "gap_nominal"), ("retuned", "gap_retuned"), ("unseen", "gap_unseen_nominal")))
    print(name, program, body_name, [c["name"] for c in told], [round(c["strength"], 4) for c in told], gap, flush=True)


def write_run(rng, path, body, run, noise, level, reference, options):
    pick = slice(run["cut"], None, run["every"])
    dt = run["dt"] * run["every"]
    t = np.arange(run["shown"].shape[0])[pick] * run["dt"]
    columns = {}
    still = np.diag(body.stiffness) / np.diag(body.M + body.A_inf)
    jitter = np.zeros(t.size)
    if noise == "jitter":
        jitter = rng.uniform(-0.3, 0.3, t.size) * dt
    grid = np.arange(run["shown"].shape[0]) * run["dt"]
    for i, dof in enumerate(body.dofs):
        x = np.interp(t + jitter, grid, run["shown"][:, i])
        kind = noise if noise != "jitter" else "white"
        columns[dof] = (units(dof)[0], x + sensor_noise(rng, x, level, kind, dt, reference[i]))
        if "acceleration" in options:
            a = run["a"][pick, i]
            size = max(np.std(a), reference[i] * still[i])
            columns[f"{dof}_acceleration"] = (units(dof)[2], a + sensor_noise(rng, a, level, "white", dt, size))
    if run["kind"] != "decay":
        both = rng.uniform() < 0.4
        if "elevation" in options or both:
            columns["wave_elevation"] = (
                "m",
                run["eta"][pick] + 0.004 * np.std(run["eta"]) * rng.standard_normal(t.size),
            )
        if "elevation" not in options:
            for i, dof in enumerate(body.dofs):
                columns[f"{dof}_force"] = (units(dof)[3], run["force"][pick, i])
    write_record(
        path,
        "decay" if run["kind"] == "decay" else "waves" if "wave_elevation" in columns else "forced",
        t - t[0],
        columns,
    )


if __name__ == "__main__":
    chosen = sys.argv[3:]
    for one in SPECS:
        if not chosen or one[0] in chosen:
            try:
                write_case(one, sys.argv[1], sys.argv[2])
            except Exception as error:  # one case that fails must not stop the rest; it is printed and left out
                print(one[0], "FAILED", type(error).__name__, error, flush=True)
