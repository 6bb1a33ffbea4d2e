"""The demo: the tank test of Hanaki, Takaoka & Minoura (2022) from dimensions to a page, simulated at every stage."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

import radiation_ss as rss
from radiation_ss import page, style
from radiation_ss.arrays import FloatArray
from radiation_ss.atomic import made_folder
from radiation_ss.body.model import Model
from radiation_ss.diagnosis.result import Diagnosis
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData
from radiation_ss.identification.result import Identification
from radiation_ss.page import Page, Part, Picture, Table, Text, Verdict, number
from radiation_ss.records.record import Record
from radiation_ss.report.diagnosis_page import page_of, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure


Progress = Callable[[str, float], None]
Stage = Callable[[str], None]

HALF_BREADTH = 0.1
# What the simulated experiments suffer from.
ERROR = 0.15  # relative standard deviation of the parameters that identification starts from
NOISE = 0.01  # of the sensors, relative to the motion
DT, T01 = 0.02, 0.9
BEAM = (0.5 * np.pi,)  # the waves run along y
STAGES = 9  # that progress is told of
HIDDEN = ("quadratic_drag", "Heave", 90.0)  # an effect that the diagnosed model does not have [kg/m]


def tank_hydro(frequencies: int = 100, length: float = 0.297, depth: float = 0.45) -> HydroData:
    """Return heave coefficients of the paper's body (its section 4) in the tank, from the section solver."""
    omega = np.geomspace(0.3, 30.0, frequencies)  # rad/s
    section = rss.lewis_section(HALF_BREADTH, draft=0.1, area_ratio=0.9)
    data = rss.section_2d(section, omega, depth, gyradius=0.7 * HALF_BREADTH)
    return data.times(length).select("Heave").replace(source="tank of Hanaki et al. (2022)")


def tank_model(hydro: HydroData, order: int = 3) -> Model:
    """Return the Cummins model of the body with a passive radiation model of the paper's order."""
    return Model.from_hydro(hydro, rss.fit_radiation(hydro, order))


@dataclass(frozen=True, eq=False)
class DemoEstimate:
    """One way to identify the radiation model, scored against the known truth."""

    name: str
    error_of_K: float  # Norm of the error of K(iw) in the band of the waves over the norm of K
    error_of_force: float  # Root mean square of the force's error over that of the force; NaN where it gives none
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

    `out`: folder; made if it is not there. `seed`: of waves, sensor noise and filters. `progress`: told of each stage
    as it begins.
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
    found = rss.diagnose(model, records, withhold=[unseen], seed=seed)
    stage("page")
    demo = Demo(hydro, model, record, start.fit, estimates, error_of(start.fit, model.fit), found, seconds)
    write_files(demo, [*records, unseen], folder)
    stage("done")
    return demo


def wave_record(model: Model, rng: np.random.Generator, name: str, duration: float = 30.0) -> Record:
    """Return the motion in the paper's sea (case 2), with sensor noise and the true force, as a linear record."""
    sea = rss.realise(rss.jonswap(0.01, t01=T01), duration, DT, seed=rng, directions=BEAM)
    force = rss.exciting_force(model, sea)
    response = rss.linear_response(model, sea.time, force)
    clean = {"Heave": response.outputs[0], "Heave_velocity": response.outputs[1],
             "Heave_acceleration": response.outputs[2]}
    return Record(sea.time, {**noisy(clean, rng), "Heave_force": force[0]}, kind="waves", name=name)


def noisy(channels: dict[str, FloatArray], rng: np.random.Generator) -> dict[str, FloatArray]:
    """Add white sensor noise of NOISE times each channel's rms."""
    return {name: x + NOISE * np.sqrt(np.mean(x**2)) * rng.standard_normal(x.size) for name, x in channels.items()}


def disturbed(model: Model, rng: np.random.Generator) -> Model:
    """Return the model with each parameter of its radiation model wrong by ERROR, still stable and passive."""
    from radiation_ss.fit.rational import observer_form

    den, num = model.fit.polynomials()
    while True:
        a, b, c = observer_form(den * np.r_[1.0, 1.0 + ERROR * rng.standard_normal(den.size - 1)],
                                num * (1.0 + ERROR * rng.standard_normal(num.size)))
        wrong = RadiationFit(model.dofs, a, b, c, order=model.fit.order, A_inf=model.A_inf, method="disturbed")
        if wrong.stable and wrong.passive:
            return model.replace(fit=wrong, hydro=None)  # its table is the truth


def error_of(fit: RadiationFit, truth: RadiationFit) -> float:
    """Return the error of K over the band of the waves, 0.6 to 1.8 times their mean frequency."""
    omega = np.linspace(0.6, 1.8, 60) * 2.0 * np.pi / T01
    wanted = truth.frequency_response(omega)
    return float(np.linalg.norm(fit.frequency_response(omega) - wanted) / np.linalg.norm(wanted))


def identified(model: Model, start: Model, record: Record, seed: int, stage: Stage) -> tuple[DemoEstimate, ...]:
    """Identify the radiation model from motion alone, from the wrong start, in three ways."""
    motion = Record(record.time, {k: v for k, v in record.channels.items() if not k.endswith("_force")},
                    kind="motion-only", name=record.name)
    known_at = np.sqrt(np.array([0.3, 1.0]) * 9.81 / HALF_BREADTH)  # K b where the radiation is known (25)-(27)
    points = {float(w): model.fit.frequency_response(w)[0] for w in known_at}
    made = []
    ways = {"dual filter": ("dual-enkf", None), "dual filter with two known points": ("dual-enkf", points),
            "motion's spectrum": ("spectral", None)}
    for name, (method, known) in ways.items():
        stage(name)
        result = rss.identify(start, motion, method, prior=ERROR, points=known, seed=seed)
        force = result.force.get(record.name)
        truth = record.channels["Heave_force"]
        wrong = np.nan if force is None else float(np.linalg.norm(force.mean[0] - truth) / np.linalg.norm(truth))
        made.append(DemoEstimate(name, error_of(result.fit, model.fit), wrong, result))
    return tuple(made)


def hidden_effect_records(hydro: HydroData, rng: np.random.Generator) -> tuple[list[Record], Record]:
    """Return records of a body with quadratic drag and a radiation model of higher order: two seen, one unseen."""
    body = Model.from_hydro(hydro, rss.fit_radiation(hydro, 6))
    drag = [(HIDDEN[0], HIDDEN[1], {"coefficient": HIDDEN[2]})]
    time = np.arange(0.0, 20.0, DT)
    decay = rss.simulate(body, (time, np.zeros((1, time.size))), drag, start={"Heave": 0.04})
    channels = noisy({"Heave": decay.outputs[0], "Heave_acceleration": decay.outputs[2]}, rng)
    records = [Record(time, {**channels, "Heave_force": np.zeros(time.size)}, kind="decay", name="decay_40mm")]
    for height, name in ((0.04, "waves_40mm"), (0.05, "waves_50mm_unseen")):
        sea = rss.realise(rss.jonswap(height, t01=T01), 40.0, DT, seed=rng, directions=BEAM)
        force = rss.exciting_force(body, sea)
        moved = rss.simulate(body, (sea.time, force), drag)
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
    rss.write_hydro(demo.hydro, folder / "tank.nc")
    for record in [demo.record, *records]:
        rss.write_record(record, folder / f"{record.name}.csv")


def demo_page(demo: Demo, diagnosed: Page) -> Page:
    """Return the page of the demo; the sections of the diagnosis come from its own page."""
    fit = demo.model.fit
    rows = [["prior model", number(demo.error_at_start), "–"],
            *([e.name, number(e.error_of_K), number(e.error_of_force)] for e in demo.estimates)]
    radiation = Part("Radiation: from the section to a state-space model", [
        Text(f"A panel method gives added mass and damping of the section in water of {demo.hydro.depth:g} m. A fit of "
             f"order {fit.order}, stable and passive by construction, is the radiation model. Certificate: "
             f"{fit.certificate}."),
        picture(fit.plot(), "Added mass, damping, Nyquist plot and retardation kernel: solver (points) and fit.")])
    motion = Part("Identification from thirty seconds of motion", [
        Text(f"The parameters of the prior model are wrong by {ERROR:.0%}, the sensors have {NOISE:.0%} noise, the "
             "force is unknown. Errors are relative to the simulated truth, in the band of the waves."),
        Table(["", "error of K(iω)", "error of the force"], rows,
              "Motion alone hardly determines a linear body under an unknown force; known points of K or the spectrum "
              "of the sea do."),
        picture(identification_picture(demo), "Damping and added mass with 95 % bands, and the force from motion.")])
    told = Text("The simulated body has an effect that the model does not have, and radiation of higher order. The "
                "diagnosis sees two records; a third one is withheld.")
    return Page("A floating body in the paper's tank", [
        Part("", [Verdict(str(demo.diagnosis), "good" if demo.diagnosis.verdict.status == "effect" else "warn")]),
        radiation, motion, Part("The sim-to-real gap", [told]), *diagnosed.sections[1:]],
        subtitle="Hanaki, Takaoka & Minoura (2022): Lewis section b = d = 0.1 m, σ = 0.90, depth 0.45 m",
        footer="Computed by radiation-ss demo from the body's dimensions.")


def picture(figure: "Figure", caption: str) -> Picture:
    """Return a picture whose caption serves as its description."""
    return Picture(figure, caption, caption)


@style.look()
def identification_picture(demo: Demo) -> "Figure":
    """Damping, added mass and force, estimated from motion, against the truth."""
    figure, rows = style.figure(len(demo.estimates), 3, size=(11.0, 2.5 * len(demo.estimates) + 0.4))
    for (*axes, right), estimate in zip(rows, demo.estimates):
        found, record = estimate.result, demo.record
        K = demo.model.fit.frequency_response(found.omega)[:, 0, 0]
        truth = {"B": K.real, "A": K.imag / found.omega + demo.model.A_inf[0, 0]}
        for ax, name, band, label in zip(axes, "BA", (found.B, found.A), ("damping B [kg/s]", "added mass A [kg]")):
            style.band(ax, found.omega, band.lower[:, 0, 0], band.upper[:, 0, 0], style.BLUE, "95 % band")
            ax.plot(found.omega, band.mean[:, 0, 0], color=style.BLUE, label="estimate")
            ax.plot(found.omega, found.prior[name][:, 0, 0], color=style.GREY, linestyle=":", label="prior model")
            ax.plot(found.omega, truth[name], color=style.VERMILION, linestyle="--", label="truth")
            ax.set(ylabel=label, xlim=(0.0, 16.0), title=estimate.name, xlabel="ω [rad/s]")
        if (force := found.force.get(record.name)) is not None:
            part = (force.time >= 10.0) & (force.time <= 18.0)
            style.band(right, force.time[part], force.lower[0, part], force.upper[0, part], style.BLUE)
            right.plot(force.time[part], force.mean[0, part], color=style.BLUE)
        part = (record.time >= 10.0) & (record.time <= 18.0)
        right.plot(record.time[part], record.channels["Heave_force"][part], color=style.VERMILION, linestyle="--")
        right.set(ylabel="wave excitation force [N]", title="force from motion", xlabel="time [s]")
    rows[0, 0].legend(loc="lower left", fontsize=7)
    return figure
