"""The demo: a tank test from the body's dimensions to a page, with fit, identification and diagnosis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from radiation_ss import page
from radiation_ss.arrays import FloatArray
from radiation_ss.atomic import made_folder
from radiation_ss.body.model import Model
from radiation_ss.diagnosis.diagnose import Diagnosis, diagnose
from radiation_ss.fit.radiation import fit_radiation
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.files import write_hydro
from radiation_ss.identification.identify import Identification, identify
from radiation_ss.page import number
from radiation_ss.records.record import Record
from radiation_ss.records.record_files import write_record
from radiation_ss.report.demo_page import demo_page
from radiation_ss.report.diagnosis_page import page_of, save
from radiation_ss.report.tank import ERROR, HALF_BREADTH, NOISE, tank_hydro, tank_model
from radiation_ss.simulation.linear import linear_response
from radiation_ss.simulation.run import simulate
from radiation_ss.waves.force import exciting_force
from radiation_ss.waves.realise import realise
from radiation_ss.waves.spectrum import jonswap

Progress = Callable[[str, float], None]
Stage = Callable[[str], None]

DT, DURATION, H13, T01 = 0.02, 30.0, 0.01, 0.9
POINTS = (0.3, 1.0)  # K b of the frequencies where the radiation is known (25)-(27)
BEAM = (0.5 * np.pi,)  # the waves run along y
STAGES = 9  # that progress is told of
HIDDEN = ("quadratic_drag", "Heave", 90.0)  # an effect that the diagnosed model does not have [kg/m]


@dataclass(frozen=True, eq=False)
class DemoEstimate:
    """One way to identify the radiation model, scored against the known truth.

    Parameters
    ----------
    name : str
    error_of_K : float
        Norm of the error of K(iw) in the band of the waves over the norm of K.
    error_of_force : float
        Root mean square of the force's error over that of the force; NaN where it gives none.
    result : Identification
    """

    name: str
    error_of_K: float
    error_of_force: float
    result: Identification


@dataclass(frozen=True, eq=False)
class Demo:
    """What the demo found."""

    hydro: HydroData
    model: Model
    record: Record
    start: RadiationFit
    estimates: tuple[DemoEstimate, ...]
    error_at_start: float
    diagnosis: Diagnosis
    seconds: dict[str, float]

    @property
    def summary(self) -> dict[str, Any]:
        """The numbers, ready for JSON."""
        return {"fit": {"order": self.model.fit.order, "passive": self.model.fit.passive,
                        "relative_error": self.model.fit.relative_error},
                "identification": {"start": {"error_of_K": self.error_at_start},
                                   **{e.name: {"error_of_K": e.error_of_K, "error_of_force": e.error_of_force}
                                      for e in self.estimates}},
                "diagnosis": self.diagnosis.to_dict(), "seconds": self.seconds}

    @property
    def text(self) -> str:
        """The result in a few lines."""
        lines = [f"Radiation model: {self.model.fit!r}",
                 f"Error of K(iw) in the band of the waves: {self.error_at_start:.3f} of the prior model"]
        lines += [f"  {e.name}: {e.error_of_K:.3f}, force error {number(e.error_of_force)}" for e in self.estimates]
        return "\n".join([*lines, str(self.diagnosis)])


def run_demo(out: str | Path, seed: int = 0, progress: Progress | None = None) -> Demo:
    """Run every stage on the paper's tank and write the page, the model and the records into a folder.

    Parameters
    ----------
    out : path
        Folder; made if it is not there.
    seed : int
        Of waves, sensor noise and filters.
    progress : callable(text, share), optional
        Told of each stage as it begins.
    """
    folder = made_folder(out)
    seconds: dict[str, float] = {}
    begun = perf_counter()

    def stage(text: str) -> None:
        seconds[text] = perf_counter() - begun
        if progress is not None:
            progress(text, len(seconds) / STAGES)

    waves_rng, start_rng, hidden_rng = np.random.default_rng(seed).spawn(3)
    stage("section solver")
    hydro = tank_hydro()
    stage("passive fit")
    model = tank_model(hydro)
    stage("thirty seconds of waves")
    record = wave_record(model, waves_rng, "waves_30s")
    start = disturbed(model, start_rng)
    estimates = identified(model, start, record, seed, stage)
    stage("diagnosis of a withheld effect")
    records, unseen = hidden_effect_records(hydro, hidden_rng)
    found = diagnose(model, records, withhold=[unseen], seed=seed)
    stage("page")
    demo = Demo(hydro, model, record, start.fit, estimates, error_of(start.fit, model.fit), found, seconds)
    write_files(demo, [*records, unseen], folder)
    stage("done")
    return demo


def wave_record(model: Model, rng: np.random.Generator, name: str, duration: float = DURATION) -> Record:
    """Return the motion in the paper's sea (case 2), with sensor noise and the true force, as a linear record."""
    sea = realise(jonswap(H13, t01=T01), duration, DT, seed=rng, directions=BEAM)
    force = exciting_force(model, sea)
    response = linear_response(model, sea.time, force)
    clean = {"Heave": response.outputs[0], "Heave_velocity": response.outputs[1],
             "Heave_acceleration": response.outputs[2]}
    return Record(sea.time, {**noisy(clean, rng), "Heave_force": force[0]}, kind="waves", name=name)


def noisy(channels: dict[str, FloatArray], rng: np.random.Generator) -> dict[str, FloatArray]:
    """Add white sensor noise of NOISE times each channel's rms."""
    return {name: x + NOISE * np.sqrt(np.mean(x**2)) * rng.standard_normal(x.size) for name, x in channels.items()}


def disturbed(model: Model, rng: np.random.Generator) -> Model:
    """Return the model with each parameter of its radiation model wrong by ERROR, still stable and passive."""
    from radiation_ss.fit.rational import observer_form, polynomials

    den, num = polynomials(model.fit)
    while True:
        a, b, c = observer_form(den * np.r_[1.0, 1.0 + ERROR * rng.standard_normal(den.size - 1)],
                                num * (1.0 + ERROR * rng.standard_normal(num.size)))
        wrong = RadiationFit(model.dofs, a, b, c, order=model.fit.order, A_inf=model.A_inf, method="disturbed")
        if wrong.stable and wrong.passive:
            return model.replace(fit=wrong)


def error_of(fit: RadiationFit, truth: RadiationFit) -> float:
    """Return the error of K over the band of the waves, 0.6 to 1.8 times their mean frequency."""
    omega = np.linspace(0.6, 1.8, 60) * 2.0 * np.pi / T01
    wanted = truth.frequency_response(omega)
    return float(np.linalg.norm(fit.frequency_response(omega) - wanted) / np.linalg.norm(wanted))


def identified(model: Model, start: Model, record: Record, seed: int, stage: Stage) -> tuple[DemoEstimate, ...]:
    """Identify the radiation model from motion alone, from the wrong start, in three ways."""
    motion = Record(record.time, {k: v for k, v in record.channels.items() if not k.endswith("_force")},
                    kind="motion-only", name=record.name)
    points = {float(w): model.fit.frequency_response(w)[0] for w in np.sqrt(np.array(POINTS) * 9.81 / HALF_BREADTH)}
    made = []
    ways: tuple[tuple[str, str, dict | None], ...] = (
        ("dual filter", "dual-enkf", None), ("dual filter with two known points", "dual-enkf", points),
        ("motion's spectrum", "spectral", None))
    for name, method, known in ways:
        stage(name)
        result = identify(start, motion, method, prior=ERROR, points=known, seed=seed)
        force = result.force.get(record.name)
        truth = record.channels["Heave_force"]
        wrong = np.nan if force is None else float(np.linalg.norm(force.mean[0] - truth) / np.linalg.norm(truth))
        made.append(DemoEstimate(name, error_of(result.fit, model.fit), wrong, result))
    return tuple(made)


def hidden_effect_records(hydro: HydroData, rng: np.random.Generator) -> tuple[list[Record], Record]:
    """Return records of a body with quadratic drag and a radiation model of higher order: two seen, one unseen."""
    body = Model.from_hydro(hydro, fit_radiation(hydro, 6))
    drag = [(HIDDEN[0], HIDDEN[1], {"coefficient": HIDDEN[2]})]
    time = np.arange(0.0, 20.0, DT)
    rest = np.zeros(body.fit.states + 2)
    rest[body.fit.states] = 0.04
    decay = simulate(body, (time, np.zeros((1, time.size))), drag, start=rest)
    channels = noisy({"Heave": decay.outputs[0], "Heave_acceleration": decay.outputs[2]}, rng)
    records = [Record(time, {**channels, "Heave_force": np.zeros(time.size)}, kind="decay", name="decay_40mm")]
    for height, name in ((0.04, "waves_40mm"), (0.05, "waves_50mm_unseen")):
        sea = realise(jonswap(height, t01=T01), 40.0, DT, seed=rng, directions=BEAM)
        force = exciting_force(body, sea)
        moved = simulate(body, (sea.time, force), drag)
        channels = noisy({"Heave": moved.outputs[0], "Heave_acceleration": moved.outputs[2]}, rng)
        records.append(Record(sea.time, {**channels, "Heave_force": force[0], "wave_elevation": sea.elevation},
                              kind="waves", name=name))
    return records[:2], records[2]


def write_files(demo: Demo, records: list[Record], folder: Path) -> None:
    """Write the page, the diagnosis and the files that the command line can go on with."""
    diagnosed = page_of(demo.diagnosis)
    save(demo.diagnosis, folder / "diagnosis", diagnosed)
    page.write(demo_page(demo, diagnosed), folder / "report.html")
    demo.model.fit.write(folder / "fit.json")
    write_hydro(demo.hydro, folder / "tank.nc")
    for record in [demo.record, *records]:
        write_record(record, folder / f"{record.name}.csv")
