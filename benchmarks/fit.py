# ruff: noqa: E501  (rows of tables)
"""Radiation fits side by side: matrices, entries, points, the paper's tank, our own bodies, files, arrays.

    OMP_NUM_THREADS=1 python benchmarks/fit.py [--only matrices,entries,points,tank,own,files,arrays]
                                               [--bodies 100] [--bem FOLDER]

Needs the third-party data folder (RADIATION_SS_DATA or ../shared/data), scikit-rf and capytaine. Writes docs/validation/fit.md,
with --only its sections.
Times are processor seconds on one core, including what other work on the machine costs in cache.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import radiation_ss as rss
from radiation_ss.fit.choices import nearest_possible, weights_of
from radiation_ss.fit.problem import joint_error
from radiation_ss.fit.rational import observer_form, side_by_side

FOLDER = Path(os.environ.get("RADIATION_SS_DATA", ROOT.parent / "shared" / "data")) / "bem"
SETS = ("bem_wecsim_sphere", "bem_wecsim_ellipsoid", "bem_wecsim_cylinder", "mss_fpso", "mss_tanker", "bem_wecsim_rm3")
MODES = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
Rows = Iterator[str]


def load(name: str) -> rss.HydroData:
    arrays = np.load(FOLDER / f"{name}.npz")
    n, positive = arrays["A"].shape[1], arrays["w"] > 0.0
    dofs = MODES if n == 6 else [f"body{k + 1}__{mode}" for k in range(n // 6) for mode in MODES]
    return rss.HydroData(arrays["w"][positive], arrays["A"][positive], arrays["B"][positive], arrays["Ainf"], dofs=dofs,
                         rho=1000.0 if name.startswith("mss") else 1.0, source=name)


def dense_margin(fit: rss.RadiationFit, top: float) -> float:
    """Return the smallest eigenvalue of the scaled Hermitian part on a grid from 0 to 30 times the highest frequency."""
    grid = np.concatenate([np.linspace(0.0, 1.5 * top, 6000), np.geomspace(1e-5 * top, 30.0 * top, 6000)])
    K = fit.frequency_response(grid)
    size = np.sqrt(np.maximum(np.einsum("wii->wi", K).real.max(axis=0), 1e-300))
    values = np.linalg.eigvalsh(0.5 * (K + np.conj(np.swapaxes(K, 1, 2))) / np.outer(size, size))
    return float(values.min() / values.max())


def timed(action: Callable[[], rss.RadiationFit]) -> tuple[rss.RadiationFit, float]:
    start = time.process_time()
    return action(), time.process_time() - start


def matrices() -> Rows:
    yield "## Whole matrices, K(0) = 0"
    yield ""
    yield ("Error: ||K - K_fit|| / ||K|| over all samples and entries, scaled by max |K_ii|, all samples alike. Published: MSS's "
           "own fits; RM3: 697 states (BEMIO). \"up to\": order None.")
    yield ""
    yield "| set | order | states | error | passive on a dense grid | suspicious samples | CPU s |"
    yield "|---|---|---|---|---|---|---|"
    for name in SETS:
        data = load(name)
        if name.startswith("mss"):
            score = rss.audit(FOLDER / f"{name}.npz", data)
            yield (f"| {name}, published | | {score.states} | {score.relative_error:.3f} | "
                   f"{score.certificate.margin:.0e} | | |")
        order = 4 if data.n > 6 else None
        fit, seconds = timed(lambda data=data, order=order: rss.fit_radiation(data, order, at_zero="zero"))
        label = order or f"up to {fit.order}"
        yield (f"| {name} | {label} | {fit.states} | {rss.audit(fit, data).relative_error:.4f} | "
               f"{dense_margin(fit, data.omega[-1]):.0e} | {len(fit.suspects)} | {seconds:.1f} |")


def entries() -> Rows:
    yield "## Diagonal entries, all sets (42 entries), K(0) = 0"
    yield ""
    yield "| method | order | median error | 90 % of entries below | stable | passive | median CPU s |"
    yield "|---|---|---|---|---|---|---|"
    singles = [load(name).select(dof) for name in SETS for dof in load(name).dofs]
    for order in (6, 8):
        rss.fit_radiation(singles[0], order, at_zero="zero")  # builds the program
        yield table_row("this package", order, [timed(lambda d=d, n=order: rss.fit_radiation(d, n, at_zero="zero"))
                                                for d in singles])
        yield table_row("scikit-rf VectorFitting", order, [timed(lambda d=d, n=order: vector_fit(d, n)) for d in singles])
    few = [load("bem_wecsim_cylinder").select(dof) for dof in MODES] + [load("mss_fpso").select(dof) for dof in MODES]
    yield table_row("this package, 12 entries", 4, [timed(lambda d=d: rss.fit_radiation(d, 4, at_zero="zero")) for d in few])
    yield table_row("quasi-newton (8), 12 entries", 4,
                    [timed(lambda d=d: rss.fit_radiation(d, 4, at_zero="zero", method="quasi-newton")) for d in few])


def table_row(method: str, order: int, runs: list[tuple[rss.RadiationFit, float]]) -> str:
    errors = [fit.relative_error for fit, _ in runs]
    return (f"| {method} | {order} | {np.median(errors):.4f} | {np.quantile(errors, 0.9):.3f} | "
            f"{np.mean([fit.stable for fit, _ in runs]):.0%} | {np.mean([fit.passive for fit, _ in runs]):.0%} | "
            f"{np.median([seconds for _, seconds in runs]):.2f} |")


def vector_fit(data: rss.HydroData, order: int) -> rss.RadiationFit:
    """Return scikit-rf's vector fit of one entry as a fit of ours, for the same scores."""
    import skrf
    from skrf.vectorFitting import VectorFitting

    size = np.abs(data.K).max()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fitting = VectorFitting(skrf.Network(f=data.omega / (2.0 * np.pi), f_unit="hz", s=data.K / size, z0=1.0))
        fitting.vector_fit(n_poles_real=0, n_poles_cmplx=order // 2, fit_constant=False, fit_proportional=False)
    parts = []
    for pole, residue in zip(fitting.poles, fitting.residues[0]):
        a = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
        parts.append((a, np.array([[2.0], [0.0]]), np.array([[residue.real, residue.imag]]) * size))
    a, b, c = side_by_side(parts, [[0]] * len(parts), [[0]] * len(parts), 1)
    fit = rss.RadiationFit(data.dofs, a, b, c, order=order, method="vector fitting")
    return fit.replace(relative_error=rss.audit(fit, data).relative_error)


def points() -> Rows:
    yield "## Frequency points (25)-(27)"
    yield ""
    yield "| set | order | points | largest relative miss | error without, with |"
    yield "|---|---|---|---|---|"
    for name, dofs, order, count in (("bem_wecsim_sphere", ["Heave"], 5, 1), ("bem_wecsim_sphere", ["Heave"], 6, 2),
                                     ("bem_wecsim_cylinder", ["Surge", "Pitch"], 6, 1), ("mss_fpso", list(MODES[::2]), 4, 1)):
        data = load(name).select(dofs)
        power = np.abs(np.einsum("wii->wi", data.K)).sum(axis=1)
        at = data.omega[[int(np.argmax(power)), int(np.argmax(power) * 1.6)][:count]]
        plain = rss.fit_radiation(data, order, at_zero="zero")
        fit = rss.fit_radiation(data, order, at_zero="zero", points=at)
        K = data.K[np.isin(data.omega, at)]
        K = 0.5 * (K + np.swapaxes(K, 1, 2))
        size = np.sqrt(np.abs(np.einsum("wii->wi", data.K)).max(axis=0))
        miss = np.abs((fit.frequency_response(at) - K) / np.outer(size, size)).max()
        yield (f"| {name} {', '.join(dofs)} | {order} | {', '.join(f'{w:.3g}' for w in at)} rad/s | {miss:.0e} | "
               f"{plain.relative_error:.4f}, {fit.relative_error:.4f} |")


def tank() -> Rows:
    yield "## The paper's tank: heave kernel of order 3"
    yield ""
    yield ("Section solver at 0.45 m depth, band 0.5 to 22 rad/s; numerator over rho, per unit length, so that it stands beside "
           "Table 3 (which may be over rho g b instead: 2 % apart).")
    yield ""
    yield "| | a1 | a2 | a3 | b1 | b2 | b3 | error on K | passive |"
    yield "|---|---|---|---|---|---|---|---|---|"
    data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 22.0, 60), depth=0.45).select("Heave")
    table = {"Table 3, 2D-BEM": ((1130.3213, 230.9063, 22.0178), (105.7441, 12.9617, 0.5849)),
             "the same, times g b": ((1130.3213, 230.9063, 22.0178), tuple(0.981 * b for b in (105.7441, 12.9617, 0.5849))),
             "Table 3, mean of Case 1 to 3": ((1101.6021, 235.2769, 22.4536), (107.0370, 12.7068, 0.5821))}
    fits = {"passive": rss.fit_radiation(data, 3), "free": rss.fit_radiation(data, 3, passive=False),
            "quasi-newton (8)": rss.fit_radiation(data, 3, method="quasi-newton")}
    for label, (den, num) in table.items():
        a, b, c = observer_form(den, num)
        score = rss.audit(rss.RadiationFit(("Heave",), a, 1000.0 * b, c, order=3), data)
        yield row_of(label, den, num, score.relative_error, score.passive)
    for label, fit in fits.items():
        den, num = fit.polynomials()
        yield row_of(label, den, num / 1000.0, fit.relative_error, fit.passive)


def row_of(label: str, den, num, error: float, passive: bool) -> str:
    return (f"| {label} | {den[0]:.1f} | {den[1]:.2f} | {den[2]:.3f} | {num[0]:.2f} | {num[1]:.3f} | {num[2]:.4f} | "
            f"{error:.4f} | {passive} |")


def own() -> Rows:
    yield "## Bodies that the fit was not tuned on (capytaine; coarse meshes, one without a lid, with its irregular frequencies)"
    yield ""
    yield "| body | order | states | error | blocks | stable, passive | dense grid | suspicious samples | CPU s |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for name, data in bodies():
        fit, seconds = timed(lambda data=data: rss.fit_radiation(data, 5, at_zero="zero"))
        blocks = "; ".join("+".join(dof.split("__")[-1] for dof in block) for block in fit.blocks)
        yield (f"| {name} | 5 | {fit.states} | {fit.relative_error:.4f} | {blocks} | {fit.stable}, {fit.passive} | "
               f"{dense_margin(fit, data.omega[-1]):.0e} | {len(fit.suspects)} | {seconds:.1f} |")


def bodies() -> Iterator[tuple[str, rss.HydroData]]:
    import capytaine as cpt

    cpt.set_logging("ERROR")
    shapes = {"barge 40 x 12 x 4 m": cpt.mesh_parallelepiped(size=(40.0, 12.0, 8.0), resolution=(16, 6, 4)),
              "raft 10 x 10 x 1 m": cpt.mesh_parallelepiped(size=(10.0, 10.0, 2.0), resolution=(8, 8, 2)),
              "horizontal cylinder": cpt.mesh_horizontal_cylinder(length=12.0, radius=2.0, resolution=(2, 16, 12))}
    shapes["barge, no lid"] = shapes["barge 40 x 12 x 4 m"]
    for name, whole in shapes.items():
        mesh = whole.immersed_part()
        lid = None if "no lid" in name else mesh.generate_lid()
        body = cpt.FloatingBody(mesh=mesh, lid_mesh=lid, dofs=cpt.rigid_body_dofs(rotation_center=(0.0, 0.0, 0.0)))
        solver = cpt.BEMSolver()
        omega = np.linspace(0.08, 3.2, 40)
        problems = [cpt.RadiationProblem(body=body, radiating_dof=dof, omega=w) for w in [*omega, np.inf] for dof in body.dofs]
        dataset = cpt.assemble_dataset(solver.solve_all(problems, progress_bar=False))
        order = {"radiating_dof": list(body.dofs), "influenced_dof": list(body.dofs)}
        A = dataset.added_mass.sel(order).transpose("omega", "influenced_dof", "radiating_dof").values
        B = dataset.radiation_damping.sel(order).transpose("omega", "influenced_dof", "radiating_dof").values
        yield name, rss.HydroData(omega, A[:-1], B[:-1], A[-1], dofs=tuple(body.dofs), rho=1000.0, source=name)


def files(folder: Path | None = None) -> Rows:
    yield "## Files of coefficients, order 6"
    yield ""
    yield ("With --bem, also public files. Diagonal: median error of the "
           "entries, all samples alike; joint: weighted as in the fit (in the data themselves, where half or more; silent motions left out). All are passive. UMaineSemi.ss: y = -K v.")
    yield ""
    yield "| file | dofs, states | diagonal | joint | CPU s |"
    yield "|---|---|---|---|---|"
    runs = []
    for name, data in whole_files(folder):
        fit, seconds = timed(lambda data=data: rss.fit_radiation(data, 6))
        weights = weights_of(fit.data, fit.suspects)
        least = joint_error(fit.data, nearest_possible(fit.data), weights)
        runs.append((fit.relative_error, fit.states, seconds))
        yield (f"| {name} | {data.n}, {fit.states} | {np.nanmedian(np.diag(fit.entry_error)):.3f} | "
               f"{fit.relative_error:.3f}{f' ({least:.3f})' * (least > 0.5 * fit.relative_error)} | {seconds:.1f} |")
    error, states, seconds = np.array(runs).T
    yield (f"| median of {error.size} files; at most .05: {np.mean(error <= 0.05):.0%} | {np.median(states):.0f} | | "
           f"{np.median(error):.3f} | {np.median(seconds):.1f}, largest {seconds.max():.1f} |")
    iea = FOLDER / "formats" / "iea15"
    published = rss.audit(iea / "UMaineSemi.ss", rss.read_hydro(iea / "UMaineSemi.1", rho=1025.0))
    yield (f"| UMaineSemi.ss, published | 6, {published.states} | {published.diagonal_error:.3f} | "
           f"{published.relative_error:.3f} | |")


def whole_files(folder: Path | None = None) -> Iterator[tuple[str, rss.HydroData]]:
    for name in SETS:
        yield name, load(name)
    for name in ("cylinder_capytaine.nc", "nemoh3_sphere", "raft_cylinder.1", "rm3_capytaine.nc", "sphere.1", "sphere.AH1",
                 "sphere_bemio.h5", "sphere_capytaine.nc", "iea15/UMaineSemi.1"):
        yield name, rss.read_hydro(FOLDER / "formats" / name, **({"rho": 1025.0} if "iea15" in name else {}))
    for path in sorted(folder.iterdir(), key=lambda path: path.stat().st_size) if folder else ():
        yield path.name, rss.read_hydro(path)


def arrays(largest: int = 100) -> Rows:
    yield "## Arrays of N heaving point absorbers"
    yield ""
    yield ("B_ij = B(w) J0(k r_ij) in a row, 2 m apart, B = w^3 exp(-w^2), k = 4 w^2 / g, A by the Kramers-Kronig relation; one joint "
           "passive model of 4 or 6 states a body. Slope: of the time from one N to the next.")
    yield ""
    yield "|N|error, 4|CPU s|slope|error, 6|CPU s|slope|"
    yield "|---|---|---|---|---|---|---|"
    before: dict[int, tuple[int, float]] = {}
    for count in (n for n in (4, 16, 32, 64, 100) if n <= largest):
        data, row = array_of(count), f"|{count}|"
        for order in (4, 6):
            fit, seconds = timed(lambda data=data, order=order: rss.fit_radiation(data, order))
            fewer, faster = before.get(order, (count, seconds))
            slope = f"{np.log(seconds / faster) / np.log(count / fewer):.1f}" if fewer < count else ""
            row += f"{fit.relative_error:.4f}|{seconds:.1f}|{slope}|"
            before[order] = count, seconds
        yield row
    count = min(largest, 32)
    fit = rss.fit_radiation(array_of(count), 4)
    yield ""
    yield f"With 4 and {count} bodies, not passive: {error_if_free(fit):.4f}."


def error_if_free(fit: rss.RadiationFit, steps: int = 3000) -> float:
    """Return the relative error after L-BFGS over poles and residues of rank one from a fit, passivity given up."""
    data, scale = fit.data, np.sqrt(np.abs(np.einsum("wii->wi", fit.data.K)).max(axis=0))
    s, K = 1j * data.omega[:, None], data.K / np.outer(scale, scale)
    poles, vectors = np.linalg.eig(fit.a)
    left = np.linalg.inv(vectors) @ fit.b / scale  # K_model = sum over k of c_k c_k^T / (s - p_k)
    C = left.T * np.sqrt((fit.c @ vectors / scale[:, None] * left.T).sum(axis=0) / (left.T**2).sum(axis=0))
    half = np.where(poles.imag == 0.0, np.sqrt(0.5), 1.0)[poles.imag >= 0.0]  # a real pole is its own partner
    poles, C = poles[poles.imag >= 0.0], C[:, poles.imag >= 0.0] * half

    def misfit(v: np.ndarray) -> tuple[float, np.ndarray]:
        p, C = v[:poles.size], v[poles.size:].reshape(data.n, -1)
        over, mirrored = 1.0 / (s - p), 1.0 / (s - p.conj())
        miss = (C * over[:, None]) @ C.T + (C.conj() * mirrored[:, None]) @ C.conj().T - K
        near, far = miss.conj() @ (C * over[:, None]), miss @ (C * mirrored.conj()[:, None])  # d K by C and by its conjugate
        by_C = 4.0 * (near + far).sum(axis=0)
        by_p = 2.0 * (np.einsum("wik,ik,wk->k", near, C, over) + np.einsum("wik,ik,wk->k", far, C, mirrored.conj()))
        return float(np.sum(np.abs(miss) ** 2)), np.concatenate([by_p, by_C.ravel()]).conj()

    def real(v: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = misfit(v.view(complex))
        return value / size, slope.view(float) / size

    size = float(np.sum(np.abs(K) ** 2))
    start = np.concatenate([poles, C.ravel()]).astype(complex).view(float)
    found = minimize(real, start, jac=True, method="L-BFGS-B", options={"maxiter": steps, "maxfun": 2 * steps, "maxcor": 30})
    return float(np.sqrt(found.fun))


def array_of(count: int, spacing: float = 2.0) -> rss.HydroData:
    """Return point absorbers in a row with coefficients that satisfy the Kramers-Kronig relations."""
    from scipy.special import j0

    fine, omega = np.arange(1, 4001) * 0.01, np.linspace(0.0625, 3.9625, 40)
    distance = spacing * np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    K = np.zeros((omega.size, count, count), dtype=complex)
    for apart in np.unique(distance):
        B = fine**3 * np.exp(-(fine**2)) * j0(4.0 * fine**2 / 9.81 * apart)
        at = np.interp(omega, fine, B)
        principal = ((B - at[:, None]) / (omega[:, None] ** 2 - fine**2)).sum(axis=1) * 0.01
        K[:, distance == apart] = (at - 2j / np.pi * omega * principal)[:, None]
    return rss.HydroData(omega, np.eye(count) + K.imag / omega[:, None, None], K.real, np.eye(count),
                         dofs=tuple(f"b{k}__Heave" for k in range(count)))


ASKED = """Asked: every set stable and passive, by certificate and on a dense grid from 0 to 30 times the highest frequency (smallest
scaled eigenvalue >= -1e-9 of the largest); diagonal entries, median error <= .05 at order 6 and <= .03 at order 8; FPSO below 69
states and error .148, tanker below 55 and .438, RM3 below 697 states; six degrees of freedom <= 10 s, RM3 <= 60 s, one entry
<= 0.2 s after the first; points met to 1e-8. Files: joint error <= .05 in <= 3 s, more
states never worse, order=None never worse than order 6. Arrays: N = 100 in <= 600 s, error <= .05, slope <= 2.5."""

PAGE = ROOT / "docs" / "validation" / "fit.md"
PARTS = {"matrices": matrices, "entries": entries, "points": points, "tank": tank, "own": own, "files": files,
         "arrays": arrays}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default=",".join(PARTS), help="parts, with commas between")
    parser.add_argument("--bodies", type=int, default=100, help="bodies of the largest array")
    parser.add_argument("--bem", type=Path, help="folder of further .1 and .AH1 files")
    given = parser.parse_args()
    wanted = given.only.split(",")
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout.strip()
    lines = ["# Radiation fits: asked and measured", "",
             f"{date.today()}, commit {commit}. Rerun: `OMP_NUM_THREADS=1 python benchmarks/fit.py`.", "", ASKED, ""]
    for name in wanted:
        for line in PARTS[name](*{"arrays": [given.bodies], "files": [given.bem]}.get(name, [])):
            print(line, flush=True)
            lines.append(line)
        print()
        lines.append("")
    if set(wanted) == set(PARTS):
        PAGE.write_text("\n".join(lines), encoding="utf-8")
    else:
        PAGE.write_text(replaced(PAGE.read_text(encoding="utf-8"), "\n".join(lines), commit), encoding="utf-8")


def replaced(page: str, new: str, commit: str) -> str:
    """Return the page with the sections that were measured anew, each with its commit."""
    sections = page.split("\n## ")
    for section in new.split("\n## ")[1:]:
        title, rest = section.split("\n", 1)
        titles = [old.split("\n", 1)[0] for old in sections]
        at = titles.index(title) if title in titles else len(sections)
        sections[at:at + 1] = [f"{title}\n\nMeasured {date.today()}, commit {commit}.\n{rest.rstrip()}\n"]
    return "\n## ".join(sections).rstrip() + "\n"


if __name__ == "__main__":
    main()
