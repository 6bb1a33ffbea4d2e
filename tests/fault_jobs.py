"""Everything that the package writes, as jobs for `faults`: each writes an old or a new version into a folder."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from gap_cases import tank_case
from plant_bodies import coupled_fit, tank_model

import radiation_ss as rss
from benchmarks.heave_tank import sea_record, start
from radiation_ss.blind import MANIFEST, generate
from radiation_ss.effects import activate
from radiation_ss.simulation import Corrected

TIME = np.arange(0.0, 40.0, 0.1)
Write = Callable[[Path, int], object]       # into a folder, version 0 or 1


def record(version):
    return rss.Record(TIME, {"Heave": np.sin((1.0 + 0.1 * version) * TIME), "Heave_force": np.cos(TIME)}, kind="forced",
                      name=f"run {version}")


def scaled(fit, version):
    return fit.replace(c=(1.0 + version) * fit.c)


def model(version):
    return tank_model().replace(name=f"tank {version}", C=(1.0 + version) * tank_model().C)


@cache
def excitation(version):
    data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 12)).select("Heave")
    return rss.fit_excitation(data, data.directions[0], states=4 + version)


def correction(version):
    damping = ("linear_damping", {"coefficient": 1.0 + version})
    return Corrected({("nominal_inertia", "Heave"): 0.03}, activate([damping], ("Heave",)))


@cache
def live(version):
    filter_ = rss.DualEnKF(start(version), n_ensemble=10).prepare(sea_record(0, duration=1.0)[0])
    filter_.step({"time": 0.0, "Heave": 1e-3})
    return filter_


@cache
def identification(version):
    given, _ = sea_record(version, duration=10.0)
    return rss.identify(start(version), [given], method="spectral", seed=version)


@cache
def diagnosis(version):
    body, records = tank_case([("linear_damping", "Heave", {"coefficient": 8.0})], version, duration=15.0)
    return rss.diagnose(body, records[:3], withhold=records[3:], effects=["linear_damping", "quadratic_drag"])


@cache
def plan(version):
    return rss.plan_tests(tank_model(), 0.02 * (1.0 + version), tests=["decay"])


def draw(seed):
    return {"draw": np.random.default_rng(seed).standard_normal(3)}


def files() -> dict[str, Write]:
    """Return the writers of one file, by its name."""
    found: dict[str, Write] = {
        f"run{end}": lambda folder, version, end=end: rss.write_record(record(version), folder / f"run{end}")
        for end in (".csv", ".csv.gz", ".parquet")}
    one, two = tank_model().fit, coupled_fit(("Surge", "Heave"))
    found |= {f"fit{end}": lambda folder, version, fit=fit, end=end: scaled(fit, version).write(folder / f"fit{end}")
              for fit, end in ((one, ".json"), (one, ".mat"), (two, ".ss"), (two, ".h5"))}
    return found | {
        "model.nc": lambda folder, version: model(version).write(folder / "model.nc"),
        "hydro.nc": lambda folder, version: rss.write_hydro(coefficients(version), folder / "hydro.nc"),
        "x.ssexctn": lambda folder, version: excitation(version).write(folder / "x.ssexctn"),
        "corrected.json": lambda folder, version: correction(version).write(folder / "corrected.json"),
        "filter.npz": lambda folder, version: live(version).save(folder / "filter.npz")}


@cache
def coefficients(version):
    omega = np.linspace(1.0, 8.0, 12 + version)
    return rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), omega)


def folders() -> dict[str, Write]:
    """Return the writers of several files, by what they are; the version changes nothing in studies and blind runs."""
    return {"identification": lambda folder, version: identification(version).save(folder),
            "diagnosis": lambda folder, version: diagnosis(version).save(folder),
            "plan": lambda folder, version: plan(version).save(folder)}


def resumed() -> dict[str, Callable[[Path], object]]:
    """Return what goes on where it was stopped: a study, and the making of a blind run."""
    return {"repeat": lambda folder: rss.repeat(draw, 20, chunk=4, folder=folder / "study"), "blind run": made}


def made(folder):
    """Make a blind run as `blind.run` does: one that is whole is left alone."""
    if not (folder / "blind" / MANIFEST).exists():
        generate(folder / "blind", 1, 5, kinds=("decays",), groups=("none",), bodies=("heave",))
