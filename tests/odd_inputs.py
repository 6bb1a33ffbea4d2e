"""Odd inputs through the command line: files of spreadsheets and loggers, files that are none, numbers without sense.

Each case is a function of a folder (with tank.nc, fit.json and run.csv in it) that returns the words of a command, and
what may come of it: "same", the output of the plain file; "refused", status 2 with one line; "either".
"""

import contextlib
import gzip
import io
import os
import signal
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

import radiation_ss as rss
from radiation_ss.cli import main
from radiation_ss.report import tank_hydro

LONGEST = 1200   # characters of a message
SECONDS = 20     # of a case


def write_sound(folder: Path) -> None:
    """Write the sound files: data with inertia, a fit of it, a record."""
    hydro = tank_hydro(30)
    rss.write_hydro(hydro, folder / "tank.nc")
    rss.fit_radiation(hydro, 3).write(folder / "fit.json")
    time = np.arange(0.0, 8.0, 0.04)
    rss.write_record(rss.Record(time, {"Heave": 0.02 * np.cos(5.0 * time), "Heave_force": 3.0 * np.sin(4.0 * time)},
                                kind="forced"), folder / "run.csv")


def predicted(folder: Path, name: str, *more: str) -> list[str]:
    """Return the words that predict the motion under a record's force."""
    return ["simulate", str(folder / "tank.nc"), str(folder / name), "--fit", str(folder / "fit.json"), "--out",
            str(folder / "out.csv"), *more]


def edited(change, name="odd.csv", encode=str.encode):
    """Return a case that writes the record's text, changed."""
    def make(folder):
        text = (folder / "run.csv").read_text(encoding="utf-8")
        (folder / name).write_bytes(encode(change(text)))
        return predicted(folder, name)
    return make


def rows(change):
    """Return a case that changes the header and rows, each a list of cells."""
    def changed(text):
        lines = text.splitlines()
        head = next(k for k, line in enumerate(lines) if line.startswith("time"))
        table = change([line.split(",") for line in lines[head:]])
        return "\n".join([*lines[:head], *(",".join(row) for row in table)]) + "\n"
    return edited(changed)


def comments(*lines):
    """Return a case with comment lines before the record's own."""
    return edited(lambda text: "\n".join(lines) + "\n" + text)


def put(table, row, column, value):
    """Return the table with one cell replaced."""
    table[row][column] = value
    return table


def spreadsheet(text):
    """Return the text as a spreadsheet of a country with decimal commas writes it."""
    return text.replace(",", ";").replace(".", ",")


def made(kind, name="odd.csv"):
    """Return a case whose file is something else than a file."""
    def make(folder):
        path = folder / name
        if kind == "folder":
            path.mkdir()
        elif kind == "loop":
            path.symlink_to(path)
        elif kind == "pipe":
            os.mkfifo(path)
        elif kind == "nowhere":
            path.symlink_to(folder / "absent.csv")
        elif kind == "link":
            path.symlink_to(folder / "run.csv")
        elif kind == "endless":
            path.symlink_to("/dev/zero")
        if name.endswith((".csv", ".gz", ".parquet")):
            return predicted(folder, name)
        if name.endswith((".json", ".ss")):
            return ["audit", str(folder / "tank.nc"), str(path)]
        return ["check", str(path)]
    return make


def hydro(change, verb="check"):
    """Return a case with the data's netCDF file changed."""
    def make(folder):
        import xarray as xr

        with xr.open_dataset(folder / "tank.nc") as file:
            data = file.load()
        change(data).to_netcdf(folder / "odd.nc", engine="h5netcdf", invalid_netcdf=True)
        if verb == "check":
            return ["check", str(folder / "odd.nc")]
        return ["simulate", str(folder / "odd.nc"), str(folder / "run.csv"), "--order", "3", "--out",
                str(folder / "out.csv")]
    return make


def field(name, change):
    """Return a change of one variable of a dataset."""
    def changed(data):
        data[name] = data[name].copy(data=change(np.array(data[name].values)))
        return data
    return changed


def numbers(values):
    """Return frequencies replaced by others."""
    return lambda data: data.assign_coords(omega=values(np.array(data.omega.values)))


def words(*given):
    """Return a case of words alone; names of the sound files are looked up in the folder."""
    there = ("tank.nc", "fit.json", "run.csv", "out.csv", "out", "out.nc", "out.json")
    return lambda folder: [str(folder / w) if w in there else w for w in given]


def twice(folder):
    """Return the words of a diagnosis whose unseen record is one that it sees."""
    return [*words(*DIAGNOSE)(folder), "--withhold", str(folder / "run.csv")]


def xlsx(folder):
    """Return the words for a spreadsheet's own file that was renamed."""
    import zipfile

    with zipfile.ZipFile(folder / "odd.csv", "w") as file:
        file.writestr("xl/workbook.xml", "<workbook/>")
    return predicted(folder, "odd.csv")


SIMULATE = ("simulate", "tank.nc", "--fit", "fit.json", "--out", "out.csv")
DIAGNOSE = ("diagnose", "tank.nc", "run.csv", "--fit", "fit.json", "--effects", "linear_damping", "--out", "out")
IDENTIFY = ("identify", "tank.nc", "run.csv", "--fit", "fit.json", "--method", "prediction-error", "--out", "out")
FIT = ("fit", "tank.nc", "--out", "out.json")

DRESSES = {     # the same numbers
    "byte order mark and CRLF": edited(lambda t: t.replace("\n", "\r\n"), encode=lambda t: t.encode("utf-8-sig")),
    "CR alone": edited(lambda t: t.replace("\n", "\r")),
    "blanks around names and cells": rows(lambda t: [[f"  {cell} " for cell in row] for row in t]),
    "all cells in quotes": rows(lambda t: [[f'"{cell}"' for cell in row] for row in t]),
    "no units": rows(lambda t: [[cell.partition(" [")[0] for cell in t[0]], *t[1:]]),
    "no blank before units": rows(lambda t: [[cell.replace(" [", "[") for cell in t[0]], *t[1:]]),
    "columns in another order": rows(lambda t: [row[::-1] for row in t]),
    "empty lines before, between and after": rows(lambda t: [[""], *t[:3], [""], *t[3:], [""], [""]]),
    "rows of commas after the data": rows(lambda t: [*t, *[[""] * len(t[0])] * 3]),
    "numbers with a plus sign": rows(lambda t: [t[0], *([f"+{c}" if not c.startswith("-") else c for c in row]
                                                       for row in t[1:])]),
    "semicolons": edited(lambda t: t.replace(",", ";")), "semicolons and decimal commas": edited(spreadsheet),
    "units in a line of their own": rows(lambda t: [[cell.partition(" [")[0] for cell in t[0]],
                                                    ["s", "m", "N"], *t[1:]]),
    "names as loggers write them": rows(lambda t: [["Time_s", "HEAVE (m)", '"Heave force, N"'], *t[1:]]),
    "tabs": edited(lambda t: t.replace(",", "\t")),
    "tabs and decimal commas": edited(lambda t: t.replace(",", "\t").replace(".", ",")),
    "a symbolic link": made("link"),
    "UTF-16": edited(str, encode=lambda t: t.encode("utf-16")),
    "#N/A of a spreadsheet": rows(lambda t: put(t, 5, 1, "#N/A")),
}
RECORDS = {
    "a column twice": rows(lambda t: [[*row, row[1]] for row in t]),
    "a column twice, one with a unit": rows(lambda t: [[*t[0], "Heave"], *([*row, row[1]] for row in t[1:])]),
    "time twice": rows(lambda t: [[row[0], *row] for row in t]),
    "no name": rows(lambda t: put(t, 0, 1, "")), "a unit alone": rows(lambda t: put(t, 0, 1, "[m]")),
    "NaN in time": rows(lambda t: put(t, 9, 0, "nan")), "time empty": rows(lambda t: put(t, 9, 0, "")),
    "time infinite": rows(lambda t: put(t, 9, 0, "inf")),
    "time descending": rows(lambda t: [t[0], *t[:0:-1]]), "time twice the same": rows(lambda t: put(t, 9, 0, t[8][0])),
    "all time empty": rows(lambda t: [t[0], *(["", *row[1:]] for row in t[1:])]),
    "time of day": rows(lambda t: [t[0], *([f"2024-01-01T00:{k:04d}", *row[1:]] for k, row in enumerate(t[1:]))]),
    "time in an unknown unit": rows(lambda t: put(t, 0, 0, "time [fortnight]")),
    "a force in a unit of mass": rows(lambda t: put(t, 0, 2, "Heave_force [kg]")),
    "two units in one cell": rows(lambda t: put(t, 0, 1, "Heave [m] [mm]")),
    "a unit of another quantity": rows(lambda t: put(t, 0, 1, "Heave [rad]")),
    "a row of units under the header": rows(lambda t: [t[0], ["s", "m", "N"], *t[1:]]),
    "a title above the header": edited(lambda t: "Test 3 of the barge\n" + t),
    "another separator than sep=; says": edited(lambda t: "sep=;\n" + t),
    "decimal commas between commas": rows(lambda t: [t[0], *([c.replace(".", ",") for c in row] for row in t[1:])]),
    "blanks as separators": edited(lambda t: t.replace(",", "  ")),
    "thousands separators": rows(lambda t: put(t, 5, 2, '"1,234.5"')),
    "a typographic minus": rows(lambda t: put(t, 5, 2, "\u22121.5")),
    "a Fortran exponent": rows(lambda t: put(t, 5, 2, "1.0D-02")), "a percent sign": rows(lambda t: put(t, 5, 1, "2%")),
    "#VALUE!": rows(lambda t: put(t, 5, 2, "#VALUE!")),
    "a cell more": rows(lambda t: [*t[:5], [*t[5], "1"], *t[6:]]),
    "a cell less": rows(lambda t: [*t[:5], t[5][:-1], *t[6:]]),
    "a comma at each end of line": rows(lambda t: [t[0], *([*row, ""] for row in t[1:])]),
    "the header again in the middle": rows(lambda t: [*t[:9], t[0], *t[9:]]),
    "two records one after the other": rows(lambda t: [*t, *t[1:]]),
    "header only": rows(lambda t: t[:1]), "comments only": edited(lambda t: "# kind: decay\n"),
    "no byte": edited(lambda t: ""), "one newline": edited(lambda t: "\n"),
    "NUL bytes": edited(lambda t: t + "\0" * 99),
    "no header": rows(lambda t: t[1:]), "time alone": rows(lambda t: [row[:1] for row in t]),
    "one sample": rows(lambda t: t[:2]),
    "UTF-16 without its mark": edited(str, encode=lambda t: t.encode("utf-16-le")),
    "UTF-32": edited(str, encode=lambda t: t.encode("utf-32")),
    "Latin-1": edited(lambda t: "# name: größe\n" + t, encode=lambda t: t.encode("latin-1")),
    "a spreadsheet's own file": xlsx,
    "gzip under a plain name": edited(str, encode=lambda t: gzip.compress(t.encode())),
    "plain text under a gzip's name": edited(str, "odd.csv.gz"), "plain text as Parquet": edited(str, "odd.parquet"),
    "an unknown kind": edited(lambda t: t.replace("kind: forced", "kind: banana")),
    "two kinds": edited(lambda t: "# kind: decay\n" + t),
    "a decay with a force": edited(lambda t: t.replace("kind: forced", "kind: decay")),
    "a speed in words": comments("# speed: fast"), "a speed that is NaN": comments("# speed: nan"),
    "a folder": made("folder"), "a link that leads to itself": made("loop"), "a pipe": made("pipe"),
    "a link that leads nowhere": made("nowhere"), "an endless file": made("endless"),
    "an endless gzip": made("endless", "odd.csv.gz"), "a pipe as Parquet": made("pipe", "odd.parquet"),
}
BODIES = {
    **{f"{kind} as {name}": made(kind, name) for kind in ("folder", "loop", "pipe", "endless")
       for name in ("odd.nc", "odd.h5", "odd.mat", "odd.1", "odd.out", "odd.AH1", "odd.LIS", "odd.yml", "odd.json",
                    "odd.ss")},
    "negative mass": hydro(field("inertia_matrix", lambda M: -M), "simulate"),
    "no mass": hydro(field("inertia_matrix", lambda M: 0.0 * M - 0.0), "simulate"),
    "mass NaN": hydro(field("inertia_matrix", lambda M: np.nan * M), "simulate"),
    "stiffness NaN": hydro(field("hydrostatic_stiffness", lambda C: np.nan * C), "simulate"),
    "stiffness infinite": hydro(field("hydrostatic_stiffness", lambda C: np.inf * C), "simulate"),
    "one NaN in the added mass": hydro(field("added_mass", lambda A: np.where(A == A.flat[3], np.nan, A))),
    "an infinite damping": hydro(field("radiation_damping", lambda B: np.where(B == B.max(), np.inf, B))),
    "damping in text": hydro(lambda d: d.assign(radiation_damping=d.radiation_damping.astype(str))),
    "complex added mass": hydro(lambda d: d.assign(added_mass=d.added_mass * (1.0 + 0.5j))),
    "a frequency twice": hydro(numbers(lambda w: np.r_[w[:5], w[4], w[6:]])),
    "all frequencies the same": hydro(numbers(lambda w: 0.0 * w + 3.0)),
    "a negative frequency": hydro(numbers(lambda w: np.r_[-w[0], w[1:]])),
    "a frequency NaN": hydro(numbers(lambda w: np.r_[w[:5], np.nan, w[6:]])),
    "a frequency infinite twice": hydro(numbers(lambda w: np.r_[w[:-2], np.inf, np.inf])),
    "no frequency": hydro(lambda d: d.isel(omega=[])),
    "water without weight": hydro(lambda d: d.assign_coords(rho=0.0)),
    "water of NaN": hydro(lambda d: d.assign_coords(rho=np.nan)),
    "gravity upwards": hydro(lambda d: d.assign_coords(g=-9.81)),
    "depth negative": hydro(lambda d: d.assign_coords(water_depth=-3.0)),
}
WORDS = {
    **{f"simulate {' '.join(how)} {v}": words(*SIMULATE, *how, f"--duration={v}")
       for how in (("--decay", "Heave=0.1"), ("--sea", "0.1", "2")) for v in ("nan", "inf", "0", "-5", "1e18")},
    **{f"simulate decay {v}": words(*SIMULATE, "--decay", f"Heave={v}") for v in ("nan", "inf", "", "1e300", "1,5")},
    **{f"simulate sea {v}": words(*SIMULATE, "--sea", *v.split()) for v in ("nan 2", "0 2", "-1 2", "1 0", "1 inf")},
    **{f"simulate {o}={v}": words(*SIMULATE, "--sea", "0.1", "2", "--duration", "20", f"--{o}={v}")
       for o, values in (("heading", ("nan", "inf", "1e300")), ("seed", ("-1", "1.5", "x"))) for v in values},
    **{f"diagnose tolerance {v}": words(*DIAGNOSE, f"--tolerance={v}") for v in (
        "nan", "inf", "0", "-1", "", "mass=", "mass=nan", "mass=0.1,mass=0.2", "1e300")},
    **{f"diagnose seed {v}": words(*DIAGNOSE, f"--seed={v}") for v in ("-1", "1.5")},
    "diagnose effects twice": words(*DIAGNOSE[:5], "--effects", "linear_damping", "linear_damping", "--out", "out"),
    "diagnose present and absent": words(*DIAGNOSE, "--absent", "linear_damping", "--present", "linear_damping"),
    "diagnose an unknown effect": words(*DIAGNOSE, "--absent", "gremlins"),
    "an unseen record that is seen": twice,
    **{f"identify prior {v}": words(*IDENTIFY, f"--prior={v}") for v in ("nan", "inf", "0", "-1", "1e300")},
    **{f"identify points {v}": words(*IDENTIFY, f"--points={v}") for v in ("nan", "-3", "inf", "1e9")},
    **{f"fit order {v}": words(*FIT, f"--order={v}") for v in ("0", "-3", "1000000000", "2.5")},
    **{f"fit points {' '.join(v)}": words(*FIT, "--order=3", "--points", *v) for v in (
        ("nan",), ("inf",), ("0",), ("1e9",))},
    **{f"fit at zero {v}": words(*FIT, "--order=3", f"--at-zero={v}") for v in ("nan", "inf", "-1", "1e300")},
    **{f"fit rho {v}": words(*FIT, "--order=3", f"--rho={v}") for v in ("nan", "0", "-1", "inf")},
    "fit dofs twice": words(*FIT, "--order=3", "--dofs", "Heave", "Heave"),
    "fit to no name": words("fit", "tank.nc", "--out", ""),
    "simulate over its own record": words("simulate", "tank.nc", "run.csv", "--fit", "fit.json", "--out", "run.csv"),
    "simulate into /proc": words("simulate", "tank.nc", "run.csv", "--fit", "fit.json", "--out", "/proc/x.csv"),
    "fit into /dev/full": words("fit", "tank.nc", "--order=3", "--out", "/dev/full"),
    "a name with a NUL": words("check", "a\0b.nc"), "a name of 5000 letters": words("check", "x" * 5000 + ".nc"),
    **{f"model {a}={v}": words("model", "--dof", "Heave", *(f"--{k}={v if k == a else x}" for k, x in (
        ("mass", "10"), ("stiffness", "100"), ("period", "3"), ("damping-ratio", "0.05"))), "--out", "out.nc")
       for a, v in (("mass", "-5"), ("mass", "0"), ("mass", "nan"), ("mass", "inf"), ("stiffness", "0"),
                    ("stiffness", "-100"), ("stiffness", "nan"), ("period", "0"), ("period", "nan"), ("period", "-1"),
                    ("damping-ratio", "-0.1"), ("damping-ratio", "5"), ("damping-ratio", "nan"))},
}
EITHER = {      # what is right is not for this test to say; a traceback never is
    "#N/A of a spreadsheet": rows(lambda t: put(t, 5, 1, "#N/A")),      # an empty cell
    "two samples": rows(lambda t: t[:3]), "three samples": rows(lambda t: t[:4]),
    "diagnose all absent": words(*DIAGNOSE, "--absent", "linear_damping"),
    "identify with a tiny prior": words(*IDENTIFY, "--prior=1e-300"),
    "a point twice": words(*FIT, "--order=3", "--points", "5", "5"),
    "a seed of 40 digits": words(*DIAGNOSE, "--seed=" + "9" * 40),
    "no displacement": rows(lambda t: [[row[0], row[2]] for row in t]),
    "a name of markup": comments("# name: <script>alert(1)</script>"),
    "no stiffness": hydro(field("hydrostatic_stiffness", lambda C: 0.0 * C), "simulate"),
    "negative stiffness": hydro(field("hydrostatic_stiffness", lambda C: -C), "simulate"),
    "frequencies descending": hydro(lambda d: d.isel(omega=slice(None, None, -1))),
    "one frequency": hydro(lambda d: d.isel(omega=[7])),
    "all damping negative": hydro(field("radiation_damping", lambda B: -B)),
    "all coefficients zero": hydro(lambda d: d.assign(added_mass=0.0 * d.added_mass,
                                                      radiation_damping=0.0 * d.radiation_damping), "simulate"),
    "an added mass that outweighs the body below zero": hydro(field("added_mass", lambda A: A - 1e6), "simulate"),
}
def cases():
    """Return what may come of each case, and the case."""
    found = {name: ("same", make) for name, make in DRESSES.items()}
    found |= {name: ("refused", make) for name, make in (RECORDS | BODIES | WORDS).items()}
    return found | {name: ("either", make) for name, make in EITHER.items()}


class Stuck(BaseException):
    """A case that does not end."""


def stuck(*_):
    """End a case."""
    raise Stuck


def said_of(arguments):
    """Run a command; return its status and the lines on standard error that are no warnings, notes or progress."""
    errors = io.StringIO()
    before = signal.signal(signal.SIGALRM, stuck)
    signal.alarm(SECONDS)
    try:
        with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
            status = main(arguments)
    except SystemExit as end:   # argparse
        status = end.code
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return status, errors.getvalue()


@cache
def sound():
    """Return the content of the sound files, and the motion that they give."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_sound(folder)
        content = {path.name: path.read_bytes() for path in folder.iterdir()}
        said_of(predicted(folder, "run.csv"))
        return content, rss.read_record(folder / "out.csv").channels["Heave"]


def wrong_with(expected, make):
    """Return what is wrong with a case; nothing if it ends as it should."""
    content, motion = sound()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, data in content.items():
            (folder / name).write_bytes(data)
        try:
            status, text = said_of(make(folder))
        except Stuck:
            return f"not done after {SECONDS} s"
        except Exception as error:
            return f"raises {type(error).__name__}: {str(error)[:200]}"
        lines = [line for line in text.splitlines() if line.startswith("radiation-ss") and ": warning: " not in line]
        if "Traceback" in text or "internal error" in text:
            return f"status {status}: {text[-300:]}"
        if any((folder / name).read_bytes() != data for name, data in content.items()):
            return "a file that was given is lost"
        if status == 2 and (len(lines) != 1 or len(lines[0]) > LONGEST) :
            return f"{len(lines)} lines: {text[:300]}"
        if status not in (0, 1, 2) or (status == 1 and expected != "either"):
            return f"status {status}: {text[-200:]}"
        if expected == "same":
            if status != 0:
                return f"refused: {text[:300]}"
            got = rss.read_record(folder / "out.csv").channels["Heave"]
            return None if np.array_equal(got, motion) else "other numbers"
        return f"taken: {text[:200]}" if status == 0 and expected == "refused" else None
