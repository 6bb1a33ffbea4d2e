"""Write one and the same HydroData in the form of each program, from the programs' own statements of their form.

Independent of the readers: plain loops, each convention spelled out once more.
"""

import numpy as np

from radiation_ss import HydroData
from radiation_ss.hydro import wave_number

SIX = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
ROTATION = np.array([0, 0, 0, 1, 1, 1])


def body_data(bodies=("",), seed=0, nw=5, **changes):
    """Return random coefficients of rigid bodies: nothing symmetric, so that no transposition goes unseen."""
    rng = np.random.default_rng(seed)
    dofs = [f"{b}__{m}" if b else m for b in bodies for m in SIX]
    n = len(dofs)
    C = np.zeros((n, n))
    M = np.zeros((n, n))
    for k in range(len(bodies)):
        C[6 * k + 2:6 * k + 5, 6 * k + 2:6 * k + 5] = rng.normal(size=(3, 3))
        C[6 * k:6 * k + 6, 6 * k:6 * k + 6] += C[6 * k:6 * k + 6, 6 * k:6 * k + 6].T
        M[6 * k:6 * k + 6, 6 * k:6 * k + 6] = rng.normal(size=(6, 6))
    X = rng.normal(size=(nw, 2, n)) + 1j * rng.normal(size=(nw, 2, n))
    fields = dict(omega=np.round(np.sort(rng.uniform(0.3, 3.0, nw)), 3), A=1e3 * rng.normal(size=(nw, n, n)),
                  B=1e3 * rng.normal(size=(nw, n, n)), A_inf=1e3 * rng.normal(size=(n, n)), dofs=dofs, rho=1025.0,
                  g=9.80665, depth=35.0, M=1e3 * M, C=1e4 * C, X=1e4 * X, directions=np.deg2rad([0.0, 30.0]),
                  reference_point=(0.0, 0.0, -2.0))
    return HydroData(**{**fields, **changes})


def scatter(nw):
    """Return an order that is not sorted."""
    return [*range(1, nw), 0]


def wamit(data, folder, length=2.0, limits=True):
    """Write PER I J A B; PER BETA I MOD PHA RE IM; I J C: all without dimension, e^{+iwt}."""
    n = data.n
    turn = np.tile(ROTATION, n // 6)
    one, three, hst = ["header of words"], ["header of words"], ["header of words"]
    if limits:
        for i in range(n):
            for j in range(n):
                value = data.A_inf[i, j] / data.rho / length ** (3 + turn[i] + turn[j])
                one.append(f"  0.0 {i + 1} {j + 1} {value:.10e}")
    for k in scatter(len(data.omega)):
        w, period = data.omega[k], 2 * np.pi / data.omega[k]
        for i in range(n):
            for j in range(n):
                scale = data.rho * length ** (3 + turn[i] + turn[j])
                one.append(f" {period:.12e} {i + 1} {j + 1} {data.A[k, i, j] / scale:.10e} "
                           f"{data.B[k, i, j] / scale / w:.10e}")
        for h, angle in enumerate(data.directions):
            for i in range(n):
                x = data.X[k, h, i] / (data.rho * data.g * length ** (2 + turn[i]))
                three.append(f" {period:.12e} {np.degrees(angle):.6f} {i + 1} {abs(x):.10e} "
                             f"{np.degrees(np.angle(x)):.6f} {x.real:.10e} {x.imag:.10e}")
    for i in range(n):
        for j in range(n):
            value = data.C[i, j] / (data.rho * data.g) / length ** (2 + turn[i] + turn[j])
            hst.append(f" {i + 1} {j + 1} {value:.10e}")
    for suffix, lines in ((".1", one), (".3", three), (".hst", hst)):
        (folder / f"body{suffix}").write_text("\n".join(lines) + "\n")
    return folder / "body.1"


def wamit_out(data, folder, length=2.0, point=(0.0, 0.0, -2.0)):
    """Write the tables of a .out; phases are whole degrees there, so the forces are rounded to that first."""
    turn = np.tile(ROTATION, data.n // 6)
    C = data.C / (data.rho * data.g) / length ** (2.0 + turn[:, None] + turn[None, :])
    lines = [f" Gravity:     {data.g:.5f}                Length scale:        {length:.5f}",
             f" Water depth:        {'infinite' if np.isinf(data.depth) else format(data.depth, '.5f')}"]
    for k in range(data.n // 6):
        c = C[6 * k:6 * k + 6, 6 * k:6 * k + 6]
        lines += [f" XBODY = {point[0]:.4f} YBODY = {point[1]:.4f} ZBODY = {point[2]:.4f} PHIBODY =   0.0",
                  f" C(3,3),C(3,4),C(3,5):   {c[2, 2]:.9e} {c[2, 3]:.9e} {c[2, 4]:.9e}",
                  f" C(4,4),C(4,5),C(4,6):   {c[3, 3]:.9e} {c[3, 4]:.9e} {c[3, 5]:.9e}",
                  f"        C(5,5),C(5,6):   {c[4, 4]:.9e} {c[4, 5]:.9e}"]
    stars = " " + 72 * "*"
    lines += [stars, "", " Wave period = zero                    Wavenumber = infinite", "",
              "    ADDED-MASS COEFFICIENTS", "     I     J         A(I,J)", ""]
    scale = data.rho * length ** (3.0 + turn[:, None] + turn[None, :])
    for i in range(data.n):
        lines += [f" {i + 1} {j + 1} {data.A_inf[i, j] / scale[i, j]:.10e}" for j in range(data.n)]
    for k in scatter(len(data.omega)):
        w = data.omega[k]
        lines += [stars, f" Wave period (sec) =  {2 * np.pi / w:.12e}        Wavenumber (kL) =  1.0", "",
                  "    ADDED-MASS AND DAMPING COEFFICIENTS", "     I     J         A(I,J)         B(I,J)", ""]
        for i in range(data.n):
            lines += [f" {i + 1} {j + 1} {data.A[k, i, j] / scale[i, j]:.10e} {data.B[k, i, j] / scale[i, j] / w:.10e}"
                      for j in range(data.n)]
        lines += ["", "    DIFFRACTION EXCITING FORCES AND MOMENTS", ""]
        for h, angle in enumerate(data.directions):
            lines += [f"  Wave Heading (deg) :      {np.degrees(angle):.0f}", "", "     I     Mod     Pha"]
            x = data.X[k, h] / (data.rho * data.g * length ** (2.0 + turn))
            lines += [f" {i + 1} {abs(x[i]):.10e} {np.degrees(np.angle(x[i])):.0f}" for i in range(data.n)]
        lines += ["", stars, "    RESPONSE AMPLITUDE OPERATORS", "  1  2.0  3"]
    (folder / "body.out").write_text("\n".join(lines) + "\n")
    return folder / "body.out"


def nemoh(data, folder, wave_at=(1.5, -0.5)):
    """Write a run's folder: e^{-iwt}, force over the wave at `wave_at`; a zone for each motion."""
    n, count = data.n, data.n // 6
    x, y, z = data.reference_point
    cal = ["--- Environment", f"{data.rho} ! RHO", f"{data.g} ! G",
           f"{0 if np.isinf(data.depth) else data.depth} ! DEPTH", f"{wave_at[0]} {wave_at[1]} ! XEFF YEFF",
           "--- Description of floating bodies", f"{count} ! Number of bodies"]
    for b in range(count):
        cal += [f"--- Body {b + 1}", f"mesh\\body{b + 1}.dat ! Name of mesh file", "8 4 ! points and panels"]
        modes = [f"1 {a} 0. 0. 0." for a in ("1. 0. 0.", "0. 1. 0.", "0. 0. 1.")]
        modes += [f"2 {a} {x} {y} {z}" for a in ("1. 0. 0.", "0. 1. 0.", "0. 0. 1.")]
        cal += ["6 ! dof", *modes, "6 ! forces", *modes, "0 ! additional"]
    cal += ["--- Load cases", "1 5 0.1 3 ! frequencies", "2 0 30 ! directions"]
    folder.mkdir(exist_ok=True)
    (folder / "Nemoh.cal").write_text("\n".join(cal) + "\n")
    order = scatter(len(data.omega))
    head = ['VARIABLES="w (rad/s)"'] + [f'"A {i // 6 + 1} {i % 6 + 1}" "B {i // 6 + 1} {i % 6 + 1}"' for i in range(n)]
    lines = list(head)
    for j in range(n):
        lines.append(f'Zone t="Motion of body {j // 6 + 1} in DoF {j % 6 + 1}",I={len(order)},F=POINT')
        for k in order:
            pairs = " ".join(f"{data.A[k, i, j]:.10e} {data.B[k, i, j]:.10e}" for i in range(n))
            lines.append(f" {data.omega[k]:.7E} {pairs}")
    (folder / "RadiationCoefficients.tec").write_text("\n".join(lines) + "\n")
    lines = list(head)
    for h, angle in enumerate(data.directions):
        lines.append(f'Zone t="Excitation force - beta = {np.degrees(angle):7.3f} deg",I={len(order)},F=POINT')
        for k in order:
            # The wave is one at wave_at: seen from the origin it lags by k (x cos + y sin) there, e^{-iwt}.
            along = wave_at[0] * np.cos(angle) + wave_at[1] * np.sin(angle)
            force = np.conj(data.X[k, h]) * np.exp(-1j * wave_number(data.omega[k] ** 2 / data.g, data.depth) * along)
            pairs = " ".join(f"{abs(f):.10e} {np.angle(f):.10e}" for f in force)
            lines.append(f" {data.omega[k]:.7E} {pairs}")
    (folder / "ExcitationForce.tec").write_text("\n".join(lines) + "\n")
    if count == 1:
        for name, matrix in (("Inertia.dat", data.M), ("KH.dat", data.C)):
            np.savetxt(folder / name, matrix, fmt="%.10e")
    return folder


def aqwa(data, folder, centres=((0.0, 0.0, -2.0),)):
    """Write an .AH1 of the versions from 18.2 on: phases of e^{-iwt} over the wave at each centre of gravity."""
    count, nw, headings = data.n // 6, len(data.omega), len(data.directions)
    lines = ["* FILE VERSION", "* FREQUENCY ARE OUTPUT, IF LHFR OPTION IS ON"]
    for b in range(count):
        lines.append(f" {b + 1} {headings} {nw} " + " ".join(f"{np.degrees(a):.6f}" for a in data.directions))
        for first in range(0, nw, 6):
            lines.append("    " + " ".join(f"{w:.7f}" for w in data.omega[first:first + 6]))
    lines += ["GENERAL", *(f" {b + 1} {data.depth:.3f} {data.rho:.3f} {data.g:.5f} 0 0" for b in range(count)), "COG"]
    lines += [f" {b + 1} {c[0]:.3f} {c[1]:.3f} {c[2]:.3f}" for b, c in enumerate(centres)]

    def block(label, matrix):
        rows = [" ".join(f"{v:.10e}" for v in row) for row in matrix]
        return [f" {label} {rows[0]}", *(f"      {row}" for row in rows[1:])]

    for name, matrix in (("MASS", data.M), ("HYDSTIFFNESS", data.C)):
        lines.append(name)
        for b in range(count):
            lines += block(f"{b + 1}", matrix[6 * b:6 * b + 6, 6 * b:6 * b + 6])
    for name, matrix in (("ADDEDMASS", data.A), ("DAMPING", data.B)):
        lines.append(name)
        for b in range(count):
            for c in range(count):
                for k in range(nw):
                    lines += block(f"{b + 1} {c + 1} {k + 1}", matrix[k, 6 * b:6 * b + 6, 6 * c:6 * c + 6])
    lines.append("ADDEDMASS_HF")
    for b in range(count):
        for c in range(count):
            lines += block(f"{b + 1} {c + 1}", data.A_inf[6 * b:6 * b + 6, 6 * c:6 * c + 6])
    lines.append("FORCERAO")
    for b in range(count):
        for h, angle in enumerate(data.directions):
            for k, w in enumerate(data.omega):
                along = centres[b][0] * np.cos(angle) + centres[b][1] * np.sin(angle)
                # A wave that is one at the centre is ahead of the wave that is one at the origin.
                force = data.X[k, h, 6 * b:6 * b + 6] * np.exp(1j * wave_number(w ** 2 / data.g, data.depth) * along)
                lines.append(f" {b + 1} {h + 1} {k + 1} " + " ".join(f"{abs(f):.10e}" for f in force))
                lines.append("       " + " ".join(f"{-np.degrees(np.angle(f)):.8f}" for f in force))
    (folder / "body.AH1").write_text("\n".join(lines) + "\n")
    return folder / "body.AH1"


def bemio(data, folder, names=("body",)):
    """Write WEC-Sim's h5: A / rho, B / (rho w), X / (rho g), C / (rho g), MATLAB's row vectors."""
    import h5py

    with h5py.File(folder / "body.h5", "w") as file:
        sim = "simulation_parameters/"
        for name, value in (("w", data.omega), ("wave_dir", np.degrees(data.directions))):
            file[sim + name] = np.asarray(value)[:, None]
        for name, value in (("rho", data.rho), ("g", data.g), ("scaled", 0.0)):
            file[sim + name] = np.array([[value]])
        file[sim + "water_depth"] = "infinite" if np.isinf(data.depth) else np.array([[data.depth]])
        file["bem_data/code"] = "WAMIT"
        for k, name in enumerate(names):
            rows, group = slice(6 * k, 6 * k + 6), f"body{k + 1}/"
            file[group + "properties/name"] = name
            file[group + "properties/cg"] = np.array(data.reference_point)[:, None]
            coefficients = group + "hydro_coeffs/"
            file[coefficients + "added_mass/all"] = np.moveaxis(data.A[:, rows], 0, -1) / data.rho
            file[coefficients + "added_mass/inf_freq"] = data.A_inf[rows] / data.rho
            file[coefficients + "radiation_damping/all"] = np.moveaxis(data.B[:, rows], 0, -1) / data.rho / data.omega
            file[coefficients + "linear_restoring_stiffness"] = data.C[rows, rows] / (data.rho * data.g)
            force = data.X[:, :, rows].transpose(2, 1, 0) / (data.rho * data.g)
            file[coefficients + "excitation/re"], file[coefficients + "excitation/im"] = force.real, force.imag
    return folder / "body.h5"


def mss(data, folder):
    """Write MSS's vessel: axes forward-starboard-down, headings about that z axis, 10 rad/s for infinity."""
    from scipy.io import savemat

    down = np.diag([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
    A = np.concatenate([data.A, data.A_inf[None]])
    B = np.concatenate([data.B, 0.0 * data.A_inf[None]])
    nw, nh = len(data.omega), len(data.directions)
    amplitude, phase = np.empty((1, 6), dtype=object), np.empty((1, 6), dtype=object)
    force = data.X @ down
    for i in range(6):
        # A second speed behind the first, as MSS stores them.
        amplitude[0, i] = np.stack([np.abs(force[:, :, i]), np.zeros((nw, nh))], axis=-1)
        phase[0, i] = np.stack([np.angle(force[:, :, i]), np.zeros((nw, nh))], axis=-1)
    speeds = np.stack([np.moveaxis(down @ A @ down, 0, -1), np.zeros((6, 6, nw + 1))], axis=-1)
    savemat(folder / "body.mat", {"vessel": {
        "main": {"rho": data.rho, "g": data.g, "depth": data.depth}, "freqs": np.append(data.omega, 10.0),
        "velocities": [0.0, 5.0], "headings": -data.directions, "A": speeds, "B": np.moveaxis(down @ B @ down, 0, -1),
        "C": np.repeat((down @ data.C @ down)[:, :, None], nw + 1, axis=2), "MRB": down @ data.M @ down,
        "forceRAO": {"amp": amplitude, "phase": phase, "w": data.omega}}})
    return folder / "body.mat"


def hams(data, folder, kind=4):
    """Write a HAMS run: WAMIT form with length 1 and `kind` (Output_frequency_type) in the first column."""
    (folder / "Input").mkdir(exist_ok=True)
    (folder / "Output" / "Wamit_format").mkdir(parents=True, exist_ok=True)
    path = wamit(data, folder / "Output" / "Wamit_format", length=1.0, limits=kind in (4, 5))
    column = {4: lambda w: 2 * np.pi / w, 3: lambda w: w, 2: lambda w: wave_number(w ** 2 / data.g, data.depth),
              1: lambda w: w ** 2 / data.g, 5: lambda w: 2 * np.pi / wave_number(w ** 2 / data.g, data.depth)}[kind]
    for suffix in (".1", ".3"):
        rows = []
        for line in path.with_suffix(suffix).read_text().splitlines()[1:]:
            period, rest = line.split(maxsplit=1)
            value = float(period) if float(period) <= 0.0 else float(column(np.array([2 * np.pi / float(period)]))[0])
            rows.append(f" {value:.12e} {rest}")
        path.with_suffix(suffix).write_text("\n".join(rows) + "\n")
    x, y, z = data.reference_point
    (folder / "Input" / "ControlFile.in").write_text("\n".join([
        "   --------------HAMS Control file---------------", "",
        f"   Waterdepth  {-1.0 if np.isinf(data.depth) else data.depth:.3f}D0   (a negative value: infinite depth)",
        "    Input_frequency_type        3", f"    Output_frequency_type       {kind}",
        f"    Reference_body_center       {x:.3f}       {y:.3f}       {z:.3f}",
        "    Reference_body_length   1.D0"]) + "\n")
    blocks = {"Body Mass Matrix:": data.M, "External Linear Damping Matrix:": np.zeros((6, 6)),
              "Hydrostatic Restoring Matrix:": data.C, "External Restoring Matrix:": np.zeros((6, 6))}
    lines = [" Center of Gravity:", f"  {x:.12E}  {y:.12E}  {z:.12E}"]
    for name, matrix in blocks.items():
        lines += [f" {name}", *("  " + "  ".join(f"{v:.10E}" for v in row) for row in matrix)]
    (folder / "Input" / "Hydrostatic.in").write_text("\n".join(lines) + "\n")
    return folder


def hydrostar(data, folder, wave_at=(0.0, 0.0)):
    """Write a .rao file for each added mass, damping and force: amplitude and phase for each heading."""
    degrees = np.degrees(data.directions)
    x, y, z = data.reference_point
    depth = "Inf." if np.isinf(data.depth) else f"{data.depth:.4f}"

    def table(kind, component, rows):
        head = ["# Project :", f"# File : {kind}_{component}.rao", "#", "# Constants used in computations :",
                "#     Reference length     :     1.0000", f"#     Water density (rho)  :  {data.rho:.4f}",
                f"#     Gravity acceleration :     {data.g:.5f}", f"#     Waterdepth           :  {depth}",
                f"#     Ref.pt incident wave : (   {wave_at[0]:.4f}   {wave_at[1]:.4f})",
                "#            Forward speed :   0.0000  m/s", f"# Reference point of body 1: ({x:.4f} {y:.4f} {z:.4f})",
                "#   AMP/PHASE", "#" + 70 * "-", f"#RAOTYPE    :  {kind}", f"#COMPONENT  :  {component}",
                f"#NBHEADING     {degrees.size}", "#HEADING   " + "  ".join(f"{h:.2f}" for h in degrees),
                "#---w(r/s)" + 50 * "-"]
        (folder / f"{kind}_{component}.rao").write_text("\n".join([*head, *rows, "#ENDFILE"]) + "\n")

    for i in range(6):
        for j in range(6):
            for kind, values in (("AddedMass", data.A), ("WaveDamping", data.B)):
                table(kind, f"{i + 1}{j + 1}", [f" {w:.6f} " + degrees.size * f" {values[k, i, j]:.10e}"
                                                + degrees.size * "  0.0000" for k, w in enumerate(data.omega)])
        rows = []
        for k, w in enumerate(data.omega):
            along = wave_at[0] * np.cos(data.directions) + wave_at[1] * np.sin(data.directions)
            force = data.X[k, :, i] * np.exp(1j * wave_number(w ** 2 / data.g, data.depth) * along)
            rows.append(f" {w:.6f} " + " ".join(f"{abs(f):.10e}" for f in force) + " "
                        + " ".join(f"{np.degrees(np.angle(f)):.8f}" for f in force))
        table("Excitation", f"{i + 1}", rows)
    return folder


UNITS = {"SI": (1.0, 1000.0, 1000.0), "m kg N": (1.0, 1.0, 1.0), "km kg kN": (1000.0, 1.0, 1000.0)}


CROSSING = {"crest": 0.0, "zero up-crossing": -90.0, "trough": 180.0, "zero down-crossing": 90.0}  # lead over it more


def orcaflex(data, folder, units="SI", convention="leads", waves="frequency (rad/s)", wave_at=(3.0, -1.0),
             relative="crest"):
    """Write a vessel type of OrcaFlex in a system of units (metres, kilograms, newtons of one unit each).

    The vessel's origin is 4 m below the reference origin, which is the centre of mass; with `wave_at` None the phases
    are over the elevation at the reference origin (~).
    """
    x, y, z = data.reference_point
    metre, kilogram, newton = UNITS[units]
    length = metre ** (ROTATION[:, None] + ROTATION)
    names = ("X", "Y", "Z", "Rx", "Ry", "Rz")

    def bracket(values):
        return "[" + ", ".join(f"{v:.12g}" for v in values) + "]"

    def block(pad, start, matrix, axes=names):
        wrapped = [bracket(row).replace(", ", ",\n" + pad * " ", 1) for row in matrix]
        return [f"{' ' * pad}{', '.join(start + n for n in axes)}:", *(f"{' ' * pad}  - {row}" for row in wrapped)]

    def axis(w):
        return w if waves == "frequency (rad/s)" else 2 * np.pi / w

    general = ["  UnitsSystem: SI"] if units == "SI" else [
        "  UnitsSystem: User", *(f"  {n}Units: {u}" for n, u in zip(("Length", "Mass", "Force"), units.split())),
        f"  g: {data.g / metre:.12g}"]
    lines = ["\ufeff%YAML 1.1", "# Type: Model", "---", "General:", "  # Units", *general, "Environment:",
             f"  Density: {data.rho * metre ** 3 / kilogram:.12g}", f"  WaterDepth: {data.depth / metre:.12g}",
             "VesselTypes:", "  - Name: Vessel type1", "    # Conventions", "    RAOWaveUnit: amplitude",
             f"    WavesReferredToBy: {waves}",
             f"    RAOPhaseConvention: {convention}", "    RAOPhaseUnitsConvention: degrees",
             f"    RAOPhaseRelativeToConvention: {relative}", "    SurgePositive: forward",
             "    SwayPositive: starboard", "    HeavePositive: up", "    RollPositiveStarboard: down",
             "    PitchPositiveBow: down", "    YawPositiveBow: port", "    Draughts:", "      - Name: Draught1",
             f"        Mass: {data.M[0, 0] / kilogram:.12g}"]
    lines += block(8, "MomentOfInertiaTensor", data.M[3:, 3:] / (kilogram * metre ** 2), ("X", "Y", "Z"))
    origin = bracket(np.array([x, y, 4.0]) / metre)
    at = bracket(np.array([*wave_at, 0.0]) / metre) if wave_at else "[~, ~, ~]"
    lines += [f"        CentreOfMass: {origin}", "        LoadRAOs:", f"          RAOOrigin: {origin}",
              f"          PhaseOrigin: {at}", "          RAOs:"]
    header = ", ".join(f"RAO{m}{part}" for m in SIX for part in ("Amp", "Phase"))
    turned = np.array([1, -1, 1, 1, 1, 1])
    for h, angle in enumerate(np.degrees(data.directions)):
        lines += [f"            - RAODirection: {angle:.6g}", f"              RAOPeriodOrFrequency, {header}:"]
        for k, w in enumerate(data.omega):
            along = np.dot(wave_at or (x, y), (np.cos(data.directions[h]), np.sin(data.directions[h])))
            wave = np.exp(-1j * wave_number(w ** 2 / data.g, data.depth) * along)
            force = data.X[k, h] / wave * turned / newton * metre / metre ** ROTATION
            phase = (np.degrees(np.angle(force)) + CROSSING[relative]) * (1 if convention == "leads" else -1)
            lines.append(f"                - {bracket([axis(w), *np.stack([np.abs(force), phase], 1).ravel()])}")
        lines += [f"                - [{limit}, {bracket(np.zeros(12))[1:]}" for limit in ("0", "Infinity")]
    lines += [f"        ReferenceOrigin: {origin}", f"        ReferenceOriginDatumPosition: [{z / metre:.12g}, 0, 0]"]
    lines += block(8, "HydrostaticStiffness", data.C[2:5, 2:5] / newton * metre / length[2:5, 2:5], ("z", "Rx", "Ry"))
    lines.append("        FrequencyDependentAddedMassAndDamping:")
    for w, A, B in zip((np.inf, *data.omega), (data.A_inf, *data.A), (0.0 * data.A_inf, *data.B)):
        at = axis(w) if np.isfinite(w) else ("Infinity" if waves.startswith("freq") else 0)
        lines.append(f"          - AMDPeriodOrFrequency: {at}")
        lines += block(12, "AddedMassMatrix", A / kilogram / length)
        lines += block(12, "Damping", B / newton * metre / length)
    lines += ["    WireFrameType: Panels", "Vessels:", "  - Name: Vessel1"]
    (folder / "body.yml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "body.yml"


def aqwa_lis(data, folder, centres=None):
    """Write the tables of an AQWA-LINE listing: a page of structure k holds forces on others by the motion of k."""
    centres = centres or [data.reference_point]
    labels, count = ("X", "Y", "Z", "RX", "RY", "RZ"), data.n // 6

    def spaced(words):
        return "     * * * * " + "   ".join(" ".join(word) for word in words.split()) + " * * * *"

    def table(name, matrix):
        return ["", f"                  {name}", "                  -----", "", "      " + "   ".join(labels), "   ---",
                *(row for label, values in zip(labels, matrix)
                  for row in (f"   {label}  " + "  ".join(f"{v:.8E}" for v in values), ""))]

    def block(matrix, i, j):
        return matrix[6 * i:6 * i + 6, 6 * j:6 * j + 6]

    lines = [f"     WATER  DEPTH  . . . . . . . = {data.depth:12.4f}",
             f"     DENSITY  OF  WATER  . . . . . = {data.rho:12.3f}",
             f"     ACCELERATION  DUE  TO GRAVITY . . . = {data.g:12.5f}"]
    for b in range(count):
        M = block(data.M, b, b)
        lines += ["1", spaced(f"MASS AND INERTIA PROPERTIES OF STRUCTURE {b + 1}"),
                  f"      T O T A L         21         {M[0, 0]:.9E}           8.0442E+04", "",
                  "      INERTIA MATRIX   " + "   ".join(f"{v:.9E}" for v in M[3, 3:])]
        lines += [row for values in M[4:, 3:] for row in ("", "      " + "   ".join(f"{v:.9E}" for v in values))]
    for b, (x, y, z) in enumerate(centres):
        section = spaced(f"HYDRODYNAMIC PARAMETERS FOR STRUCTURE {b + 1}")
        lines += ["1", section, f"     THE CENTRE OF GRAVITY  AT (  {x:.4E},   {y:.4E},  {z:.4E})",
                  *table("STIFFNESS MATRIX", block(data.C, b, b))]
        for w, A, B in zip(data.omega, data.A, data.B):
            for on in range(count):
                names = ("ADDED  MASS", "DAMPING") if on == b else tuple(
                    f"H/I {name} FOR FORCE ON STR#  {on + 1}" for name in ("ADDED MASS", "DAMPING"))
                lines += ["1", section, f"      WAVE PERIOD = {2 * np.pi / w:.3f}   WAVE FREQUENCY = {w:.4f}",
                          *table(names[0], block(A, on, b)), *table(names[1], block(B, on, b))]
        kinds = (("FROUDE KRYLOV", 0.3), ("FROUDE KRYLOV + DIFFRACTION", 1.0))
        for name, share in kinds:
            for h, angle in enumerate(data.directions):
                lines += ["1", section, "", f"    {name} FORCES-VARIATION WITH WAVE PERIOD/FREQUENCY",
                          "    ---------", " PERIOD   FREQ   DIRECTION   X   Y   Z   RX   RY   RZ", ""]
                for k, w in enumerate(data.omega):
                    # A wave that is one at the centre is ahead of the wave that is one at the origin.
                    along = x * np.cos(angle) + y * np.sin(angle)
                    ahead = np.exp(1j * wave_number(w ** 2 / data.g, data.depth) * along)
                    force = share * ahead * data.X[k, h, 6 * b:6 * b + 6]
                    pairs = "  ".join(f"{abs(f):.9E} {-np.degrees(np.angle(f)):.7f}" for f in force)
                    first = f"{np.degrees(angle):.2f}" if k == 0 else ""
                    lines.append(f" {2 * np.pi / w:.2f}  {w:.3f}  {first}  {pairs}")
    lines += ["1", spaced("HYDRODYNAMIC PARAMETERS AT LOW & HIGH FREQUENCIES")]
    for b in range(count):
        lines.append(f"    F O R   S T R U C T U R E   {b + 1}")
        for w, share in ((0.001, 0.0), (100.0, 1.0)):
            lines.append(f"   WAVE FREQUENCY = {w:9.4f}(RAD/S)     ENCOUNTER FREQUENCY = {w:9.4f}(RAD/S)")
            for on in range(count):
                name = "ADDED MASS" if on == b else f"H/I ADDED MASS FOR FORCE ON STR#  {on + 1}"
                lines += table(name, share * block(data.A_inf, on, b))
            lines += table("DAMPING", 0.0 * block(data.A_inf, b, b))
    lines += ["1", spaced("STRUCTURE 1")]
    (folder / "body.LIS").write_text("\n".join(lines) + "\n")
    return folder / "body.LIS"
