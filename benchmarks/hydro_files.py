"""One sphere from six files of four programs: how far they agree, and what the check says of real BEM output.

    python benchmarks/hydro_files.py [--bemio WEC-Sim/examples/BEMIO] [--files FOLDER] [--out FILE.md]

Data: the third-party folder (RADIATION_SS_DATA, else ../shared/data). `--bemio`, the examples of a checkout of WEC-Sim,
fills the table of one body across programs; `--files`, any folder of other people's files, the table of what could be
read. Nothing is fetched.
"""

import argparse
import hashlib
import logging
import os
import re
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

import radiation_ss as rss
from radiation_ss.hydro import group_velocity, wave_number
from radiation_ss.hydro.data import mode
from radiation_ss.hydro.files import FORMATS
from radiation_ss.hydro.measures import horizontal_lead
from radiation_ss.hydro.quality import haskind, over_headings

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("RADIATION_SS_DATA", ROOT.parent / "shared" / "data")) / "bem"
BAND = (0.4, 1.8)
FILES = {"sphere.out": "WAMIT", "sphere_capytaine.nc": "Capytaine", "nemoh3_sphere": "NEMOH",
         "sphere_bemio.h5": "WAMIT", "sphere.AH1": "AQWA"}
ENTRIES = {"A11": ("A", 0, 0), "B11": ("B", 0, 0), "A33": ("A", 2, 2), "B33": ("B", 2, 2), "A55": ("A", 4, 4),
           "X1": ("X", 0), "X3": ("X", 2), "X5": ("X", 4)}
SETS = ("mss_tanker", "mss_fpso", "bem_wecsim_rm3", "bem_wecsim_ellipsoid", "bem_wecsim_sphere")


def deviation(reference, other, entry):
    """Return the largest difference per density over the band, in per cent of the curve's largest value."""
    band = (other.omega > BAND[0]) & (other.omega < BAND[1])
    if entry[0] == "X":
        head = int(np.argmin(np.abs(other.directions)))
        got = other.X[:, head, entry[1]] / (other.rho * other.g)
        want = np.interp(other.omega, reference.omega, reference.X[:, 0, entry[1]]) / (reference.rho * reference.g)
    else:
        name, i, j = entry
        got = getattr(other, name)[:, i, j] / other.rho
        want = np.interp(other.omega, reference.omega, getattr(reference, name)[:, i, j]) / reference.rho
    return 100.0 * np.abs(got - want)[band].max() / np.abs(want[band]).max()


def sphere_table():
    folder = DATA / "formats"
    reference = rss.read_hydro(folder / "sphere.1")
    rows = [["file", "depth", *ENTRIES, "C33"]]
    for name, program in FILES.items():
        other = rss.read_hydro(folder / name)
        stiffness = 100.0 * abs(other.C[2, 2] / other.rho / other.g / (reference.C[2, 2] / 1000.0 / reference.g) - 1.0)
        rows.append([f"{name} ({program})", f"{other.depth:g}",
                     *[f"{deviation(reference, other, entry):.2g}" for entry in ENTRIES.values()], f"{stiffness:.1g}"])
    return rows


BODIES = {"Sphere": "sphere", "Cylinder": "cylinder", "Ellipsoid": "ellipsoid", "Coer_Comp": "coer_comp", "RM3": "rm3",
          "OSWEC": "oswec", "Cubes": "cubes"}
CURVES = {"A11": ("A", 0), "B11": ("B", 0), "A33": ("A", 2), "B33": ("B", 2), "A55": ("A", 4), "B55": ("B", 4)}


def runs_of(folder, body, stem):
    """Return the programs' files of one body of WEC-Sim's examples."""
    wamit = next(iter(sorted((folder / "WAMIT" / body).glob("*.1"))), None)
    found = {"WAMIT": wamit, "AQWA": next(iter((folder / "AQWA" / body).glob("*.AH1")), None),
             "NEMOH 3": folder / "NEMOH" / "NEMOH_v3.0.2" / body / "Nemoh.cal",
             "Capytaine": folder / "CAPYTAINE" / stem / "outputs" / f"{stem}_hydrodynamics.nc"}
    return {name: rss.read_hydro(path) for name, path in found.items() if path is not None and path.exists()}


def band_of(data, first):
    """Return where the damping of heave is more than a tenth of its largest: there the curves matter."""
    damping = data.B[:, first + 2, first + 2]
    return data.omega[[np.argmax(damping > 0.1 * damping.max()), -1 - np.argmax(damping[::-1] > 0.1 * damping.max())]]


def body_table(folder):
    """Return a row for each body: the depth of WAMIT's run; program (depth) and the differences in A, B and C33."""
    pairs = (("AQWA", "WAMIT"), ("Capytaine", "WAMIT"), ("NEMOH 3", "Capytaine"))
    rows = [["body", "depth of WAMIT", *(f"{name} against {other}" for name, other in pairs)]]
    for body, stem in BODIES.items():
        runs = runs_of(folder, body, stem)
        bodies = 1 if body in ("OSWEC", "Cubes") else min(data.n for data in runs.values()) // 6  # base; the same cube
        for first in range(0, 6 * bodies, 6):
            label = body if runs["WAMIT"].n == 6 else f"{body}, body {first // 6 + 1}"
            cells = ["-" if name not in runs or against not in runs else
                     f"({runs[name].depth:g}): " + ", ".join(compared(runs[against], runs[name], first))
                     for name, against in pairs]
            rows.append([label, f"{runs['WAMIT'].depth:g}", *cells])
    return rows


def compared(reference, other, first):
    """Return the median difference over the band per density: the worst of A, of B, and the stiffness's, in %.

    Rotations are compared about one point where both files say theirs.
    """
    if np.isfinite(reference.reference_point).all() and np.isfinite(other.reference_point).all():
        other = other.at(reference.reference_point)
    low, high = band_of(reference, first)
    w = other.omega[(other.omega > max(low, reference.omega[0])) & (other.omega < min(high, reference.omega[-1]))]
    off = {}
    for label, (name, i) in CURVES.items():
        got, want = (np.interp(w, d.omega, getattr(d, name)[:, first + i, first + i]) / d.rho
                     for d in (other, reference))
        off[label] = 100.0 * np.median(np.abs(got - want)) / np.abs(want).max()
    worst = [max((label for label in off if label[0] == name), key=off.__getitem__) for name in "AB"]
    found = [f"{off[label]:.2g} ({label[1:]})" for label in worst]
    if other.C is None or reference.C is None or not reference.C[first + 2, first + 2]:
        return [*found, "-"]
    got, want = (d.C[first + 2, first + 2] / d.rho / d.g for d in (other, reference))
    return [*found, f"{100.0 * abs(got / want - 1.0):.2g}"]


OTHER = {"no structure 'vessel'": "MATLAB file of something else",
         "not a readable MATLAB file": "MATLAB file of classes or v7.3",
         "the results that OrcaWave exports": "YAML of something else",
         "RadiationCoefficients.tec is missing": "NEMOH input without results",
         "no line with gravity and length scale": ".out of another program",
         "not a BEMIO file": "HDF5 of something else", "variable added_mass is missing": "netCDF of something else",
         "no added mass in it": "WAMIT run without radiation",
         "not the same ones; a file is cut off": "HAMS run that stopped, forces without coefficients",
         "impulse responses over time": "impulse responses of WAMIT's F2T", "Git LFS": "pointer of Git LFS",
         "generalised modes": "WAMIT with generalised modes", "up to mode 10": "WAMIT with generalised modes"}


def candidates(folder):
    """Return the files that may hold coefficients, each content once, and how many were copies."""
    wanted, seen, files, copies = set(FORMATS) - {".in", ".3", ".2", ".hst"}, set(), [], 0
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix.lower() in wanted):
        if path.suffix.lower() in (".rao", ".cal"):  # one of many files of a folder
            if path.name in ("AddedMass_11.rao", "Nemoh.cal"):
                files.append(path)
            continue
        content = hashlib.sha256(path.read_bytes()).digest()
        copies += content in seen
        files += [path] * (content not in seen)
        seen.add(content)
    return files + [path.parents[1] for path in sorted(folder.rglob("Input/ControlFile.in"))], copies


def files_tables(folder):
    """Try every file: read, other content, refused with a sentence, or a failure; what physics says of those read."""
    files, copies = candidates(folder)
    formats, repositories, reasons, found = {}, {}, {}, []
    for path in files:
        where = path.relative_to(folder)
        rows = [table.setdefault(key, {"read": 0, "other": 0, "refused": 0, "failure": 0}) for table, key in
                ((formats, FORMATS.get(path.suffix.lower(), "hams")), (repositories, where.parts[0]))]
        try:
            data = rss.read_hydro(path)
            kind = "read"
            found.append((where, *limits(data)))
        except rss.InputError as error:
            reason = next((label for words, label in OTHER.items() if words in str(error)), None)
            kind = "refused" if reason is None or "generalised" in reason else "other"
            reason = reason or f"{path.name}: " + str(error).partition(path.name)[2].lstrip("/:, ")[:110]
            reasons[reason] = reasons.get(reason, 0) + 1
        except Exception as error:
            print("FAILURE", where, type(error), error)
            kind = "failure"
        for row in rows:
            row[kind] += 1
    kinds = ("read", "other", "refused")
    tables = {"files": [["format", "files", "read", "no coefficients", "refused"]] + [
        [key, str(sum(row.values())), *(str(row[kind]) for kind in kinds)] for key, row in sorted(formats.items())]}
    total = {kind: sum(row[kind] for row in formats.values()) for kind in (*kinds, "failure")}
    tables["files"].append(["all", str(len(files)), *(str(total[kind]) for kind in kinds)])
    some = {name.replace("+", "/"): row["read"] for name, row in sorted(repositories.items()) if row["read"]}
    names = ", ".join(f"{name} {count}" for name, count in some.items())
    tables["repositories"] = (f"{len(files)} files of {len(repositories)} repositories, {copies} copies left out. "
                              f"Read: {names}.")
    usual = sorted(((count, reason) for reason, count in reasons.items() if count > 5), reverse=True)
    print(*(reason for reason, count in reasons.items() if count <= 5), sep="\n")
    tables["reasons"] = ("Not read: " + ", ".join(f"{reason} {count}" for count, reason in usual)
                         + f". Failures {total['failure']}.")
    tables["physics"] = physics_table(found)
    return tables


def limits(data):
    """Return X/C of heave at the lowest frequency, B over Haskind's value for a round body where it is largest, the
    lead of surge and sway over heave in long waves over a quarter period, and what `all_headings` returns.
    """
    at = next((k for k, dof in enumerate(data.dofs) if mode(dof) == "Heave"), None)
    if at is None or data.X is None:
        return np.nan, np.nan, np.nan, np.nan
    lead = horizontal_lead(data.X, data.C, data.dofs, data.directions)
    B, X = data.B[:, at, at], np.abs(data.X[:, :, at])
    top = int(np.argmax(B))
    w, low = data.omega[top], data.omega[0] < 0.2 * data.omega[top]
    stiff = data.C is not None and data.C[at, at] > 0.05 * X[0].max() and low
    k = wave_number(w**2 / data.g, data.depth)
    speed = group_velocity(w, k, data.depth)
    round_ = 4.0 * data.rho * data.g * speed * B[top] / (k * np.mean(X[top] ** 2))
    return ((X[0, 0] / data.C[at, at] if stiff else np.nan), round_,
            np.nan if lead is None else lead / (0.5 * np.pi), all_headings(data))


def all_headings(data):
    """Return how far forces and damping are from Haskind's relation; NaN where headings do not go round."""
    known = over_headings(data)
    if known is None or not np.isfinite(known).any():
        return np.nan
    return max((finding.value for finding in haskind(data, 0.03)), default=0.0)


def physics_table(found):
    """Count how many of the read files meet relations that no reader knows of, and print those that do not."""
    rows = [["relation", "files", "meet it"]]
    for name, column, near in (
            ("X3 = C33 at the lowest frequency, within 15 %", 1, 0.15),
            ("Haskind, B33 = k X3² / (4 rho g v_g), where B33 is largest, within a factor of 3", 2, None),
            ("X1 and X2 lead X3 by a quarter period in long waves, within an eighth", 3, 0.5),
            ("Haskind with headings all round, every entry of B, within 15 %; else the check names it", 4, 0.15)):
        values = [(row[0], float(row[column])) for row in found if np.isfinite(row[column])]
        bad = [(where, value) for where, value in values
               if (abs(value - (column != 4)) > near if near else not 1.0 / 3.0 < value < 3.0)]
        print(name, *(f"  {where} ({value:.2g})" for where, value in bad), sep="\n")
        rows.append([name, str(len(values)), str(len(values) - len(bad))])
    return rows


def check_table():
    rows = [["data", "smallest eigenvalue of scaled B [%]", "asymmetry [%]", "Kramers-Kronig, worst [%]", "verdict"]]
    for name in SETS:
        content = np.load(DATA / f"{name}.npz")
        inside, n = content["w"] > 0.0, content["A"].shape[1]
        modes = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
        dofs = modes if n == 6 else [f"{b}__{m}" for b in ("float", "spar") for m in modes]
        data = rss.HydroData(content["w"][inside], content["A"][inside], content["B"][inside], content["Ainf"], dofs)
        rows.append([name, *_checked(data)])
    for name in ("nemoh3_sphere", "sphere_capytaine.nc"):
        rows.append([name, *_checked(rss.read_hydro(DATA / "formats" / name))])
    return rows


def _checked(data):
    report = data.check()
    causal = next((f for f in report.findings if f.kind == "Kramers-Kronig"), None)
    problems = list(dict.fromkeys(f.kind for f in report.problems))
    return [f"{100.0 * report.smallest_eigenvalue.min():.2g}", f"{100.0 * report.asymmetry.max():.2g}",
            f"{100.0 * causal.value:.2g}" if causal else "< 3", ", ".join(problems) or "no problem"]


def markdown(rows):
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bemio", type=Path)
    parser.add_argument("--files", type=Path)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "validation" / "hydro_files.md")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    commit = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    tables = {"sphere": markdown(sphere_table()), "check": markdown(check_table()),
              "stamp": f"Measured {datetime.now(UTC):%Y-%m-%d} at commit {commit.stdout.strip() or 'unknown'}."}
    if arguments.bemio:
        tables["bodies"] = markdown(body_table(arguments.bemio))
    if arguments.files:
        tables |= {name: rows if isinstance(rows, str) else markdown(rows)
                   for name, rows in files_tables(arguments.files).items()}
    text = arguments.out.read_text(encoding="utf-8")
    for name, content in tables.items():
        print(content, end="\n\n")
        text = re.sub(rf"(<!-- {name} -->\n).*?(\n<!-- end -->)", lambda m, c=content: m[1] + c + m[2], text,
                      flags=re.DOTALL)
    arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
