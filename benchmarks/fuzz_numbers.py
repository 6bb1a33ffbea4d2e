"""Attacks on the numbers: passive systems, clocks, names, degenerate records, packed files, threads.

Each attack is a function of a number of tries (or of nothing) that returns how many it made and what failed.
"""

import gzip
import os
import resource
import signal
import subprocess
import sys
import tempfile
import warnings
import zipfile
from pathlib import Path
from time import monotonic

import numpy as np
from degenerate_records import degenerate
from fit_systems import data_of, random_passive
from gap_cases import tank_case
from plant_bodies import tank_model

import radiation_ss as rss

ROOT = Path(__file__).resolve().parents[1]
Found = tuple[int, list[str]]


def bounded(job, gigabytes=4.0, seconds=60):
    """Run a job in a forked child with bounds on memory and processor time; say "done", "refused" or what failed."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (held + int(gigabytes * 2**30),) * 2)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                job()
            said = "done"
        except rss.RadiationError as error:
            said = "refused" if len(str(error)) < 1500 and "\n" not in str(error) else f"long message: {error}"
        except BaseException as error:
            said = f"{type(error).__name__}: {str(error)[:200]}"
        os.write(write, said.encode()[:4000])
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        said = pipe.read().decode()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return said or f"ended by {signal.Signals(-status).name if status < 0 else status}"


def failures(jobs, **bounds) -> Found:
    """Return how many jobs there are, and those that neither end nor are refused, each in its own process."""
    wrong = []
    for name, job in jobs.items():
        begin, said = monotonic(), bounded(job, **bounds)
        if said not in ("done", "refused"):
            wrong.append(f"{name}: {said}")
            print(f"    {monotonic() - begin:.0f} s {wrong[-1]}", flush=True)
    return len(jobs), wrong


# -- energy ----------------------------------------------------------------------------------------------------------

def energies(model, outputs):
    """Return kinetic (with A_inf) and potential energy over time from displacements and velocities."""
    x, v = outputs[: model.n], outputs[model.n:2 * model.n]
    inertia = model.M + model.A_inf
    return 0.5 * np.einsum("it,ij,jt->t", v, inertia, v) + 0.5 * np.einsum("it,ij,jt->t", x, model.C, x)


def passive_systems(tries=200) -> Found:
    """A radiation model gives no energy away: through fit_radiation, sampled, cummins and simulate."""
    wrong = []
    for seed in range(tries):
        rng = np.random.default_rng(seed)
        n = 1 + seed % 3
        dofs = ("Heave", "Roll", "Pitch")[:n]
        a, b, c = random_passive(2 + int(rng.integers(4)) + n, n, seed)
        A_inf = 3.0 * np.eye(n)
        fit = rss.fit_radiation(data_of(a, b, c, np.linspace(0.5, 40.0, 40), dofs, A_inf), 2 + seed % 3)
        # Energy that the sampled radiation force takes from any motion, at any time.
        step = rss.sampled(fit, 0.02, "tustin")
        state, work, least, most = np.zeros(fit.states), 0.0, 0.0, 0.0
        for v in rng.standard_normal((2000, n)):
            work += v @ (step.C @ state + step.D @ v)
            state = step.A @ state + step.B @ v
            least, most = min(least, work), max(most, work)
        if not fit.passive or least < -1e-9 * most:
            wrong.append(f"seed {seed}: fit or sampled, work {least:.3g} of {most:.3g}")
        # A body that is let go has no more energy later than at the start, where the radiation states are at rest.
        half = 0.3 * rng.standard_normal((n, n))
        model = rss.Model(dofs, 2.0 * np.eye(n) + half @ half.T, A_inf, np.diag(rng.uniform(20.0, 200.0, n)), fit)
        time, start = np.arange(0.0, 8.0, 0.02), rng.standard_normal(2 * n)
        for name, outputs in (("cummins", free_decay(model, time, start)), ("simulate", np.asarray(rss.simulate(
                model, (time, np.zeros((n, time.size))), start=np.r_[np.zeros(fit.states), start]).outputs))):
            energy = energies(model, outputs)
            # simulate promises 1e-3 of the motion, so 2e-3 of its energy.
            if energy.max() > (1.0 + 2e-3 * (name == "simulate") + 1e-9) * energy[0] or energy[-1] > energy[0]:
                wrong.append(f"seed {seed}: {name}, energy {energy.max() / energy[0]:.5f} of the start")
    return tries, wrong


def free_decay(model, time, start):
    """Return the outputs of rss.cummins from displacements and velocities, by its own matrix exponential."""
    from scipy.linalg import expm

    plant = rss.cummins(model)
    C = np.asarray(plant.C)
    state = np.linalg.lstsq(np.vstack([C[: 2 * model.n], _states_at_rest(plant, model)]),
                            np.r_[start, np.zeros(model.fit.states)], rcond=None)[0]
    step, rows = expm(np.asarray(plant.A) * (time[1] - time[0])), []
    for _ in time:
        rows.append(C @ state)
        state = step @ state
    return np.array(rows).T


def _states_at_rest(plant, model):
    """Return rows that pick the radiation states by their names."""
    at = [k for k, name in enumerate(plant.state_labels) if name.startswith("rad")]
    assert len(at) == model.fit.states
    return np.eye(len(plant.state_labels))[at]


# -- clocks ----------------------------------------------------------------------------------------------------------

def clocks() -> dict[str, np.ndarray]:
    """Return sample times that no tank has, by what is wrong with them."""
    t = np.arange(0.0, 20.0, 0.05)
    jump, late = t.copy(), t.copy()
    jump[200:] += 30.0 * 86400.0
    late[-1] = 1e9
    back, twice = t.copy(), t.copy()
    back[200:] -= 3.0
    twice[200] = twice[199]
    pauses = t + 3599.0 * np.floor(np.arange(t.size) / 20)
    fine = np.sort(np.r_[t, t[1:50] + 1e-9])
    return {"30 days": jump, "1e9 s at the end": late, "1e9 s at the start": np.r_[-1e9, t], "back": back,
            "twice": twice, "pauses of an hour": pauses, "steps of 1 ns": fine, "milliseconds": 1e3 * t,
            "nanoseconds": 1e9 * t, "Unix time": 1.7e9 + t, "1e300 s": 1e300 * t, "two samples, 1e9 s": t[:2] * 2e10,
            "1e-300 s": 1e-300 * t, "NaN": np.where(t == t[50], np.nan, t), "infinite": np.where(t == t[-1], np.inf, t),
            "one hour a step": 3600.0 * np.arange(t.size), "gaps that grow": np.cumsum(1.1 ** np.arange(t.size))}


def clock_attack() -> Found:
    """Each clock through what works on records: refused with the sample, or done in bounded memory and time."""
    model = tank_model()
    jobs = {}
    for name, time in clocks().items():
        def record(time=time, kind="decay"):
            motion = 0.02 * np.cos(7.0 * np.arange(time.size) * 0.05)
            return rss.Record(time, {"Heave": motion, "Heave_force": np.zeros(time.size)}, kind=kind)

        def waves(time=time):
            motion = 0.02 * np.cos(7.0 * np.arange(time.size) * 0.05)
            return rss.Record(time, {"Heave": motion, "wave_elevation": motion}, kind="waves")

        def read(record=record):
            with tempfile.TemporaryDirectory() as folder:
                given = record()
                rss.write_record(given, Path(folder) / "run.csv")
                rss.read_record(Path(folder) / "run.csv")

        jobs |= {f"{name}, {verb}": job for verb, job in {
            "read": read,
            "simulate": lambda record=record: rss.simulate(model, record()),
            "sea": lambda waves=waves: rss.identify(model, [waves()]),
            "identify": lambda record=record: rss.identify(model, [record()], method="prediction-error"),
            "filter": lambda record=record: rss.DualEnKF(model, n_ensemble=10).run(record()),
            "isolability": lambda record=record: rss.isolability(model, [record()]),
            "diagnose": lambda record=record: rss.diagnose(model, [record()], effects=["linear_damping"])}.items()}
    return failures(jobs)


# -- degenerate records ----------------------------------------------------------------------------------------------

def singular_attack() -> Found:
    """Special records through diagnose, identify and isolability: no singular matrix comes through."""
    jobs = {}
    for name, (model, records) in degenerate().items():
        jobs[f"{name}, diagnose"] = lambda m=model, r=records: rss.diagnose(m, r, effects=[
            "linear_damping", "quadratic_drag", "linear_stiffness"])
        jobs[f"{name}, identify"] = lambda m=model, r=records: rss.identify(m, r)
        jobs[f"{name}, isolability"] = lambda m=model, r=records: rss.isolability(m, r)
    return failures(jobs)


# -- names -----------------------------------------------------------------------------------------------------------

NAMES = ("a/b$\\frac{$", "größe", "größe ", "测试", "тест", "😀", "<script>alert(1)</script>", "a\nb", "", "..", "con",
         "x" * 5000, "%s{0}", "\\", "a\x00b", "'\"", "$", "&amp;", "\u202etxt", "\ud800")


def name_attack() -> Found:
    """Names of records through identify and diagnose to their folders: every file there, pages without live markup."""
    from radiation_ss.report.diagnosis_page import page_of

    body, records = tank_case([("linear_damping", "Heave", {"coefficient": 8.0})], 1, duration=15.0)
    found = rss.diagnose(body, records[:3], withhold=records[3:], effects=["linear_damping"])
    given = rss.Record(records[2].time, {"Heave": records[2].channels["Heave"]}, kind="motion-only")
    known = rss.identify(body, [given])
    estimate = next(iter(known.force.values()))

    def save_all():
        from dataclasses import replace

        with tempfile.TemporaryDirectory() as name:
            replace(known, force=dict.fromkeys(NAMES, estimate)).save(name)
            made = [path.name for path in Path(name).iterdir() if path.suffix == ".csv"]
            assert len(made) == len(NAMES), f"{len(NAMES)} records, {len(made)} files"

    def diagnosed(name):
        renamed = [rss.Record(r.time, dict(r.channels), kind=r.kind, name=name) for r in records[:3]]
        with tempfile.TemporaryDirectory() as folder:
            rss.diagnose(body, renamed, effects=["linear_damping"]).save(folder)

    def page(name):
        from dataclasses import replace

        from radiation_ss.page import write

        with tempfile.TemporaryDirectory() as folder:
            path = write(page_of(replace(found, model_name=name, notes=(name,))), Path(folder) / "report.html")
            assert "<script>alert" not in path.read_text(encoding="utf-8")

    jobs = {"all in one folder": save_all}
    jobs |= {f"page of {name[:20]!r}": lambda name=name: page(name) for name in NAMES}
    jobs |= {f"diagnosis of {name[:20]!r}": lambda name=name: diagnosed(name) for name in NAMES[:8]}
    return failures(jobs)


# -- packed files ----------------------------------------------------------------------------------------------------

def bomb_attack() -> Found:
    """Files of a few kilobytes that unpack to gigabytes: refused within 1 GiB."""
    import h5py

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with gzip.open(folder / "rows.csv.gz", "wb", 9) as file:
            file.write(b"time,Heave\n")
            for _ in range(20):
                file.write(b"0,0\n" * 5_000_000)
        with gzip.open(folder / "line.csv.gz", "wb", 9) as file:
            for _ in range(20):
                file.write(b"0" * 50_000_000)
        with zipfile.ZipFile(folder / "fit.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
            head = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (25000, 10000), }"
            with file.open("A.npy", "w", force_zip64=True) as part:
                part.write(head.ljust(127) + b"\n")
                for _ in range(20):
                    part.write(bytes(100_000_000))
        for form in ("body.nc", "body.h5", "fit.h5"):
            with h5py.File(folder / form, "w") as file:
                for key in ("added_mass", "omega", "body1/hydro_coeffs/radiation_damping/state_space/A/all",
                            "simulation_parameters/w"):
                    file.create_dataset(key, (10**6, 10**5), "f8", chunks=(1000, 1000), compression="gzip")
        import zlib

        data = zlib.compress(bytes(2**31), 1)
        (folder / "body.mat").write_bytes(b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + np.array(
            [15, len(data)], "<u4").tobytes() + data)
        jobs = {form: lambda form=form: rss.read_record(folder / form) for form in ("rows.csv.gz", "line.csv.gz")}
        jobs |= {form: lambda form=form: rss.read_hydro(folder / form) for form in ("body.nc", "body.h5", "body.mat")}
        jobs |= {f"{form} as fit": lambda form=form: rss.read_fit(folder / form) for form in (
            "fit.npz", "fit.h5", "body.mat")}
        jobs["fit.npz as checkpoint"] = lambda: rss.DualEnKF.load(folder / "fit.npz")
        said = {form: bounded(job, gigabytes=3.0) for form, job in jobs.items()}
        return len(said), [f"{form}: {text}" for form, text in said.items() if text != "refused"]


# -- threads ---------------------------------------------------------------------------------------------------------

WORK = """
import hashlib, sys
sys.path[:0] = ["tests", "."]
import numpy as np
import radiation_ss as rss
from benchmarks.heave_tank import sea_record, start
from fit_systems import data_of, random_passive
from gap_cases import tank_case
from plant_bodies import coupled_model
def said(name, *arrays):
    print(name, hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest())
a, b, c = random_passive(6, 3, 0)
fit = rss.fit_radiation(data_of(a, b, c, np.linspace(0.5, 40.0, 60), ("Heave", "Roll", "Pitch"), 3.0 * np.eye(3)), 4)
said("fit_radiation", fit.a, fit.b, fit.c)
data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 12))
said("section_2d", data.A, data.B, data.X)
model, time = coupled_model(), np.arange(0.0, 60.0, 0.1)
force = 1e5 * np.random.default_rng(0).standard_normal((2, time.size))
said("simulate", rss.simulate(model, (time, force), [("quadratic_drag", "Roll", {"coefficient": 1e5})]).outputs)
record, _ = sea_record(0, duration=10.0)
said("filter", rss.DualEnKF(start(0), seed=1).run(record).force.mean)
found = rss.identify(start(0), [record], seed=1)
said("identify", found.A.mean, found.B.lower, found.draws)
body, records = tank_case([("linear_damping", "Heave", {"coefficient": 8.0})], 1, duration=15.0)
found = rss.diagnose(body, records[:3], withhold=records[3:], effects=["linear_damping", "quadratic_drag"])
said("diagnose", np.array([c.log_evidence for c in found.which]), np.array([r.share for r in found.budget.rows]))
"""


def thread_attack() -> Found:
    """The same bits on 1, 2, 3 and 8 threads of BLAS, OpenMP and numba."""
    said = {}
    for threads in ("1", "2", "3", "8"):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
        done = subprocess.run([sys.executable, "-W", "ignore", "-c", WORK], cwd=ROOT, capture_output=True, text=True,
                              env={**os.environ, **dict.fromkeys(names, threads), "PYTHONPATH": str(ROOT)})
        said[threads] = dict(line.split() for line in done.stdout.splitlines()) or {"all": done.stderr[-200:]}
    wrong = [f"{work} on {threads} threads" for threads in said for work in said["1"]
             if said[threads].get(work) != said["1"][work]]
    return len(said["1"]) * (len(said) - 1), wrong



# -- the command line -------------------------------------------------------------------------------------------------

def odd_attack() -> Found:
    """Files of spreadsheets and loggers, files that are none, numbers without sense: in process, through the verbs."""
    import odd_inputs

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        said = {name: odd_inputs.wrong_with(*case) for name, case in odd_inputs.cases().items()}
    return len(said), [f"{name}: {what}" for name, what in said.items() if what]


ATTACKS = {
    "odd files and numbers through the command line: the same motion, or one line and status 2": odd_attack,
    "random passive systems through fit_radiation, sampled, cummins, simulate: no energy is gained": passive_systems,
    "clocks that jump, stand, run back, 1e9 s, in a decay, a sea, a filter, a diagnosis": clock_attack,
    "special but healthy records through diagnose, identify, isolability: no singular matrix": singular_attack,
    "names of records (markup, TeX, other scripts, paths): files apart, pages escaped": name_attack,
    "files of kilobytes that unpack to gigabytes": bomb_attack,
    "the same bits on 1, 2, 3 and 8 threads": thread_attack}
