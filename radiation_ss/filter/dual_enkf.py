"""The dual ensemble Kalman filter: radiation parameters and wave excitation force from motion, recursively."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import system_matrices
from radiation_ss.body.convert import ModelLike, as_model, opened
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.filter import estimate
from radiation_ss.filter.bank import UncertainPlant, bank_of, run_bank, smoothed_force
from radiation_ss.filter.checkpoint import read, write
from radiation_ss.filter.default import LEARN, DefaultEngine
from radiation_ss.filter.estimate import Band, Estimate, StepResult
from radiation_ss.filter.marginal import SampleRules, system_of
from radiation_ss.filter.members import drawing, gaussian_members, passivity
from radiation_ss.filter.named import run_general
from radiation_ss.filter.paper import PaperEngine
from radiation_ss.filter.plan import Outcome, SampleBlock, longest_step, plan_of, sampled, start_covariance
from radiation_ss.filter.prior import conditions
from radiation_ss.filter.settings import ForceModel, force_model_of, settings_of
from radiation_ss.inference.scales import SignalScales, channels, interval_of, scales_of, straightened
from radiation_ss.inference.subsystems import subsystems_of
from radiation_ss.records.convert import RecordLike, as_record
from radiation_ss.records.record import Record
from radiation_ss.simulation.unit_checks import check_decays, check_units, doubts


class DualEnKF:
    """Estimate the subsystems' parameters and the wave excitation force from a body's motion (section 3.2).

    Bands are those of the radiation's parameters: mass, A_inf and stiffness are taken as exact and the radiation's
    order as sufficient. Where they may be off, `identify` by "prediction-error" or "joint" has them free.

    Parameters
    ----------
    plant : Model, control.StateSpace, path, UncertainPlant
        Start of the estimate: its radiation model is the prior mean. A state space has the signals of `cummins`,
        continuous or sampled. An UncertainPlant has named parameters of its own; whole records only, and of the options
        seed, n_ensemble, gate and noise.
    **options
        Fields of `filter.settings.FilterSettings`: seed, preset, points, prior, n_ensemble, noise, omega, ...

    Raises
    ------
    InputError
        On a plant or on options that are not usable.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    >>> model = rss.Model(("Heave",), [[50.0]], [[30.0]], [[3000.0]], fit)
    >>> t = np.arange(0.0, 10.0, 0.02)
    >>> record = rss.Record(t, {"Heave": 0.01 * np.sin(5.0 * t)})
    >>> rss.DualEnKF(model, seed=1).run(record).force.mean.shape
    (1, 500)
    """

    def __init__(self, plant: ModelLike, **options: object) -> None:
        self.settings = settings = settings_of(options)
        self.uncertain = plant if isinstance(plant, UncertainPlant) else None
        if self.uncertain and (other := sorted(options.keys() - {"seed", "n_ensemble", "gate", "noise"})):
            raise InputError(f"{other[0]}: no option of a plant with named parameters; there are seed, n_ensemble, "
                             "gate and noise")
        self.model: Model = as_model(opened(plant))
        settings.check_noise(self.model.dofs)
        self.parts = subsystems_of(self.model.fit, settings.entries)
        self.prior_std = settings.prior_std(self.parts.theta, self.parts.names)
        self.points, self.omega = settings.known_points(self.model), settings.frequencies(self.model)
        self.units = settings.mass_and_time(self.model)
        self.engine: DefaultEngine | PaperEngine | None = None
        self._scales: SignalScales | None = None
        self._plan = plan_of(self.model, self.parts)
        self.time = self.interval = np.nan
        self.warned = False

    def prepare(self, record: RecordLike) -> "DualEnKF":
        """Start afresh, with sensor noise and the force's size taken from a record; the filter itself comes back.

        Raises
        ------
        InputError
            If a channel is missing or dead, or its unit contradicts another channel or the model.

        >>> live = rss.DualEnKF(model, seed=1).prepare(record)
        """
        if self.uncertain is not None:
            raise InputError("prepare: a plant with named parameters takes whole records; use run(record)")
        record = as_record(record, dofs=self.model.dofs)
        check_units(self.model, [record])
        check_decays(self.model, [record])
        self._start(scales_of(record, self.model, self.parts, self.settings.noise), interval_of(record.time))
        return self

    @property
    def sensor_noise(self) -> FloatArray:
        """Standard deviations of the sensors, (4, n): displacement, velocity, acceleration, force; NaN for none."""
        return self._running("sensor_noise")[1].noise

    @property
    def force_model(self) -> ForceModel:
        """How the unknown force moves, scaled to the stretch of record that `prepare` was given."""
        return self._at_start(self._running("force_model")[1])[0]

    def step(self, sample: Mapping[str, float]) -> StepResult:
        """Take one sample of live data: `time` [s] and whatever channels came; others, and NaN, count as missing.

        A second sample at the same time counts as another measurement. Warnings are those of `advance`.

        Raises
        ------
        InputError
            If `prepare` was not called, time is missing or goes back, or a channel is unknown or no number.

        >>> rss.DualEnKF(model, seed=1).prepare(record).step({"time": 0.0, "Heave": 0.001}).force.shape
        (1,)
        """
        self._running("step")
        time, y = sampled(sample, self.model.dofs)
        out = self.advance(np.array([time]), y)
        return StepResult(time, out.force[0], out.force_std[0], out.theta[0], out.theta_std[0], float(out.nis[0]),
                          int(out.taken[0].sum()))

    def run(self, record: RecordLike, *, smooth: bool = False) -> Estimate:
        """Filter a whole record; with an UncertainPlant a `PlantEstimate` comes back.

        Parameters
        ----------
        record : Record, pandas.DataFrame or path
        smooth : bool
            Give the force by all of the record instead of by its past (not the paper's filter).

        A known force is smooth between samples or, where the motion follows that better, straight: a warning says so.

        Raises
        ------
        InputError
            If the record lacks what the model needs.
        SolverError
            If the filter diverges.

        >>> rss.DualEnKF(model, seed=1).run(record, smooth=True).force.mean.shape
        (1, 500)
        """
        record = as_record(record, dofs=self.model.dofs)
        if self.uncertain is not None:
            return run_general(self.uncertain, record, self.settings, smooth=smooth)  # type: ignore[return-value]
        engine = self.prepare(record).engine
        if smooth and not isinstance(engine, DefaultEngine):
            raise InputError("smooth: only the default filter has a smoother; use preset=None")
        y = channels(record, self.model.dofs)
        out = self._advance(record.time, y)
        straight = straightened(y[3 * self.model.n:]) if isinstance(engine, DefaultEngine) else None
        if straight is not None:  # what the motion likes better, by 5 of the log likelihood
            self._start(self._running("run")[1], self.interval)
            other = self._advance(record.time, np.vstack([y[:3 * self.model.n], straight]))
            if other.nis.sum() < out.nis.sum() - 10.0:
                engine, out = self.engine, other
            else:
                self.engine, straight = engine, None
        if isinstance(engine, DefaultEngine):
            out.theta[-1], out.theta_std[-1] = engine.settle()
        force = self._smoothed(record.time, np.where(out.taken, y.T, np.nan), out.theta[-1]) if smooth else None
        said = () if straight is None else (
            "the force columns are taken as straight between samples, as `ct.forced_response` takes them: the motion "
            "follows that better than a smooth force",)
        return self._estimate(record, out, int(np.isfinite(y).sum()), force, said)

    def settle(self) -> tuple[FloatArray, FloatArray]:
        """Learn again at once from all samples, some 65536 at most; return parameters and their standard deviations.

        `run` ends with it; with live samples it happens bit by bit whenever their number has doubled. Default filter.

        >>> [part.shape for part in rss.DualEnKF.load("filter.npz").settle()]
        [(4,), (4,)]
        """
        return self._running("settle")[0].settle()

    def advance(self, time: FloatArray, y: FloatArray) -> Outcome:
        """Take many samples at once: time (nt,) and channels (4 n, nt) as `scales.channels` stacks them.

        A long record can be taken in pieces; the state between them is the same to the last bit. A RuntimeWarning
        tells once where most samples of some five periods contradict the stretch that `prepare` was given.

        Raises
        ------
        InputError
            If time goes back.
        SolverError
            If the filter diverges.

        >>> y = np.vstack([record.channels["Heave"], np.full((3, 500), np.nan)])
        >>> rss.DualEnKF(model, seed=1).prepare(record).advance(record.time, y).force.shape
        (500, 1)
        """
        out = self._advance(time, y)
        if not self.warned and isinstance(self.engine, DefaultEngine):
            for text in estimate.contradiction(self.engine.state.far, self.model.dofs, self.settings.larger):
                self.warned = True
                warnings.warn(text, RuntimeWarning, stacklevel=2)
        return out

    def _advance(self, time: FloatArray, y: FloatArray) -> Outcome:
        out = self._running("advance")[0].advance(SampleBlock.of(time, y, self.time, self.interval, self.longest))
        out.check_finite(time)
        self.time = float(time[-1])
        return out

    def save(self, path: str | Path) -> None:
        """Write the running filter to a file; `load` goes on from there with the same numbers to the last bit.

        The file appears whole or not at all: a kill or a full disk leaves the one that was there.

        >>> rss.DualEnKF(model, seed=1).prepare(record).save("filter.npz")
        """
        engine, scales = self._running("save")
        state: dict[str, Any] = {
            "time": self.time, "interval": self.interval, "longest": self.longest, "prior_std": self.prior_std,
            "omega": self.omega, "points": self.points[0], "points_K": self.points[1], "units": self.units,
            "entries": self.parts.entries, **engine.arrays()}
        write(path, self.settings, self.model, scales, self._at_start(scales)[0], state)

    @classmethod
    def load(cls, path: str | Path) -> "DualEnKF":
        """Return a filter saved by `save`, ready for the next `step`.

        Raises
        ------
        InputError
            If the file is not a saved filter, or damaged.

        >>> rss.DualEnKF(model, seed=1).prepare(record).save("filter.npz")
        >>> rss.DualEnKF.load("filter.npz").step({"time": 0.0, "Heave": 0.001}).time
        0.0
        """
        options, model, scales, state = read(path)
        filter_ = cls(model, **options)
        filter_.prior_std = state["prior_std"]
        filter_._start(scales, float(state["interval"]))
        filter_._running("load")[0].restore(state)
        filter_.time, filter_.longest = float(state["time"]), float(state["longest"])
        return filter_

    def _running(self, asked: str) -> tuple[DefaultEngine | PaperEngine, SignalScales]:
        """Return engine and scales, which `prepare` makes of a stretch of record."""
        if self.engine is None or self._scales is None:
            raise InputError(f"{asked}: call prepare(record) first, with a stretch of record to take the scales from")
        return self.engine, self._scales

    def _start(self, scales: SignalScales, interval: float, periods: float = 5.0) -> None:
        """Make the engine; live samples are compared with the prediction over some mean periods."""
        self._scales, self.time, self.interval, settings = scales, np.nan, interval, self.settings
        self.warned, recent = False, periods * 2.0 * np.pi / float(scales.omega.min()) / interval
        first, second = np.random.SeedSequence(settings.seed).spawn(2)
        rng, points = np.random.default_rng(first), conditions(self.parts, *self.points)
        if settings.preset is None:
            drawn = drawing(self.parts, self.prior_std, points, settings.point_noise, self.omega,
                            (settings.n_ensemble, rng))
            force, P = self._at_start(scales)
            rules = SampleRules(settings.gate, LEARN[settings.learn], estimate.Z95 * settings.larger, max(1.0, recent))
            self.engine = DefaultEngine(system_of(self._plan, force, scales.noise), drawn, P, rules, pace=settings.pace)
            theta = self.engine.state.theta
        else:
            members = gaussian_members(self.parts, self.prior_std, settings.n_ensemble, rng)
            self.engine = PaperEngine(self._plan, members, (scales.motion, *self.units), points, settings, second)
            theta = np.column_stack([members.theta, self.parts.theta])
        self.longest = longest_step(self.parts, self.model, theta.T)

    def _at_start(self, scales: SignalScales) -> tuple[ForceModel, FloatArray]:
        """Return the force model and the state's covariance before the first sample."""
        force = force_model_of(self.settings.force_model, scales.force, scales.omega, scales.bandwidth)
        return force, start_covariance(self.parts.fit(self.parts.theta), scales, force)

    def _smoothed(self, time: FloatArray, taken: FloatArray, centre: FloatArray, most: int = 40) -> Band:
        """Return the force by all samples taken (nt, 4 n), of `most` members: 60 000 samples still fit into memory."""
        engine, scales = self._running("run")
        members = engine.members()
        few = members[:, np.linspace(0, members.shape[1] - 1, min(members.shape[1], most)).astype(int)]
        plants = [system_matrices(self.model.replace(fit=self.parts.fit(theta))) for theta in [*few.T, centre]]
        force, P = self._at_start(scales)
        bank = bank_of(plants, force, scales.noise, P)
        return smoothed_force(run_bank(bank, time, taken, keep=True))

    def _estimate(self, record: Record, out: Outcome, there: int, smoothed: Band | None,
                  noted: tuple[str, ...]) -> Estimate:
        parts, default, engine = self.parts, self.settings.preset is None, self._running("run")[0]
        members, projected = engine.projected()
        K, A, B = estimate.coefficients(parts, self.model.A_inf, out.theta[-1], members.T, self.omega)
        passive = passivity(parts, self.omega, self.settings.point_noise).kept(parts, members.T)
        counts = {**projected, "refused": there - int(out.taken.sum()) if default else 0,
                  "not_passive": int((~passive).sum()), "not_stable": int((~parts.stable(members.T)).sum())}
        table = estimate.parameter_table(parts.names, out.theta[-1], engine.drawn(), parts.theta, self.prior_std)
        force = Band.normal(out.force.T, out.force_std.T) if smoothed is None else smoothed
        idle = None if default else DualEnKF(self.model, prior=0.0, n_ensemble=4, noise=self.settings.noise,
                                             learn="never", omega=self.omega)
        prior_model = {"theta": parts.theta, "K": parts.K(parts.theta, self.omega),
                       "force": out.baseline.T if idle is None else idle.run(record).force.mean}
        taught = isinstance(engine, DefaultEngine) and engine.information.any()
        said = (*doubts(self.model, record), *noted, *estimate.warnings_of(
            table, counts, record, self.model.dofs, self.points[0].size > 0, self.settings.preset),
            *(estimate.taken_as_exact(self.model, A) if taught else ()))
        return Estimate(self.model.dofs, record.time, force, table, members, out.nis, out.taken.sum(axis=1), counts,
                        said, self.model, parts.names, out.theta.T, out.theta_std.T, parts, self.omega, K, A, B,
                        prior_model)
