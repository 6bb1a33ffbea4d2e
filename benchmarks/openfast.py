"""What OpenFAST's own code makes of the files: the force on the platform, from what others published and what we write.

    python benchmarks/openfast.py OPENFAST [--also STEM ...] [--write]

OPENFAST: sources of OpenFAST v3.0; its SS_Radiation and SS_Excitation are compiled with gfortran, called by
openfast_driver.f90, and fed with one motion or wave at a time. Data: IEA-15's semisubmersible (RADIATION_SS_DATA).
STEM: other published models, STEM.1 and STEM.ss. Nothing is fetched. `--write`: into docs/validation/hydro_files.md.
"""

import argparse
import gzip
import logging
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from validation import publish, table

import radiation_ss as rss

HERE = Path(__file__).resolve().parent
DATA = Path(os.environ.get("RADIATION_SS_DATA", HERE.parents[1] / "shared" / "data")) / "bem" / "formats" / "iea15"
FLAGS = ["-O1", "-ffree-line-length-none", "-cpp", "-fallow-argument-mismatch", "-w", "-DOPENFAST_DOUBLE_PRECISION",
         "-fdefault-real-8"]
LIBRARY = ["SingPrec", "NWTC_Base", "SysGnuLinux", "NWTC_Library_Types", "VersionInfo", "NWTC_IO", "RANLUX",
           "NWTC_LAPACK", "NWTC_SLATEC", "NWTC_Num", "NWTC_ScaLAPACK", "ModMesh_Types", "ModMesh", "NWTC_RandomNumber",
           "ModMesh_Mapping", "NWTC_Library"]
MODULES = ["SS_Radiation_Types", "SS_Radiation", "SS_Excitation_Types", "SS_Excitation"]
FREQUENCIES, DOFS = (0.3, 0.6, 1.2), (0, 2, 4)
HEAD = ["file", "surge, heave, pitch", "from our reading"]


def built(openfast, folder):
    """Return the driver, compiled with OpenFAST's modules."""
    sources = {path.stem: path for path in openfast.rglob("*.f90")}
    old = [path for part in ("slatec", "scalapack") for path in openfast.rglob(f"NetLib/{part}/*.f")]
    subprocess.run(["gfortran", "-w", "-O1", "-std=legacy", "-c", *old], check=True, cwd=folder)
    for name in (*LIBRARY, *MODULES):
        subprocess.run(["gfortran", *FLAGS, "-c", sources[name]], check=True, cwd=folder)
    objects = [f"{name}.o" for name in MODULES]
    library = [path.name for path in folder.glob("*.o") if path.name not in objects]
    subprocess.run(["ar", "rcs", "library.a", *library], check=True, cwd=folder)
    subprocess.run(["gfortran", *FLAGS, HERE / "openfast_driver.f90", *objects, "library.a", "-ldl", "-o", "driver"],
                   check=True, cwd=folder)
    return folder / "driver"


def force(driver, mode, path, omega, dof=0):
    """Return the complex force for unit velocity of a degree of freedom, or for unit elevation."""
    words = [driver, mode, path.with_suffix(""), str(omega), str(dof + 1)]
    lines = subprocess.run(words, check=True, capture_output=True, text=True).stdout.splitlines()
    rows = np.array([line.split() for line in lines if len(line.split()) == 8], dtype=float)
    basis = np.column_stack([np.cos(omega * rows[:, 0]), -np.sin(omega * rows[:, 0])])
    real, imaginary = np.linalg.lstsq(basis, rows[:, 2:], rcond=None)[0]
    return real + 1j * imaginary


def at(omega, data, values):
    """Return values of the data's frequencies at one."""
    return np.interp(omega, data.omega, values.real) + 1j * np.interp(omega, data.omega, values.imag)


def row(driver, name, path, data):
    """Return a row: HydroDyn's force over that of the coefficients in the middle of FREQUENCIES, and the largest
    difference from what this package reads in the file."""
    mode = "exc" if path.suffix == ".ssexctn" else "rad"
    model = rss.read_excitation(path) if mode == "exc" else rss.read_fit(path)
    cells, off = [], 0.0
    for omega in FREQUENCIES:
        for j in DOFS:
            found = force(driver, mode, path, omega, j)[j]
            if mode == "exc":
                head = int(np.argmin(np.abs(data.directions)))
                want, own = at(omega, data, data.X[:, head, j]), np.ravel(model.frequency_response([omega]))[j]
            else:
                place = [dof.rpartition("__")[2] for dof in model.dofs].index(data.dofs[j])
                want, own = -at(omega, data, data.K[:, j, j]), -model.frequency_response([omega])[0, place, place]
            if omega == FREQUENCIES[1]:
                cells.append(f"{(found / want).real:.2f}{(found / want).imag:+.2f}i")
            off = max(off, abs(found - own) / abs(own))
    return [f"{name}, {model.a.shape[0]} states", ", ".join(cells), f"{off:.0e}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("openfast", type=Path)
    parser.add_argument("--also", type=Path, nargs="*", default=[])
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    logging.disable(logging.WARNING)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        driver = built(given.openfast.resolve(), folder)
        for path in DATA.iterdir():
            shutil.copyfile(path, folder / path.name)
        (folder / "UMaineSemi.3").write_bytes(gzip.decompress((DATA / "UMaineSemi.3.gz").read_bytes()))
        data = rss.read_hydro(folder / "UMaineSemi.1", rho=1025.0)
        rss.fit_radiation(data, 6).write(folder / "written.ss")
        rss.fit_excitation(data, 0.0, states=38).write(folder / "written.ssexctn")
        rows = [row(driver, f"{label} {end}" if stem == "written" else f"{label}{end}", folder / f"{stem}{end}", data)
                for end in (".ss", ".ssexctn")
                for label, stem in (("published UMaineSemi", "UMaineSemi"), ("ours", "written"))]
        for stem in given.also:
            other = rss.read_hydro(stem.with_suffix(".1"), rho=1025.0)
            shutil.copyfile(stem.with_suffix(".ss"), folder / "other.ss")
            rows.append(row(driver, f"published {stem.name}.ss", folder / "other.ss", other))
    publish("hydro_files", given.write, openfast=table(HEAD, rows))


if __name__ == "__main__":
    main()
