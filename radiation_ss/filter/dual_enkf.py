"""The dual ensemble Kalman filter: parameters of the radiation memory and exciting force from motion, recursively."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.checkpoint import read, write
from radiation_ss.filter.draws import seeded
from radiation_ss.filter.engines import DRAWS, LEARN, Engine, MarginalEngine, Outcome, PrintedEngine, Units
from radiation_ss.filter.estimate import (
    Z95,
    Band,
    Estimate,
    Sample,
    coefficient_bands,
    parameter_table,
    warnings_of,
)
from radiation_ss.filter.force_model import ForceModel, coloured, persistence
from radiation_ss.filter.members import Members, drawing, gaussian_members
from radiation_ss.filter.plan import plan_of, substeps
from radiation_ss.filter.printed import Constraint, Noise
from radiation_ss.filter.pseudo_observation import rows
from radiation_ss.filter.settings import choice, frequencies_of, paper_units, points_or_none
from radiation_ss.filter.smoother import smoothed_force
from radiation_ss.inference.points import Points
from radiation_ss.inference.scales import Scales, channels, scales_of
from radiation_ss.inference.subsystems import subsystems
from radiation_ss.records.record import Record
from radiation_ss.simulation.unit_checks import check_decays, check_units, doubts

PRESETS = (None, "paper")
PAPER_VARIANCE = 8.0739e-5  # section 5.1: R, and Q = R


class DualEnKF:
    """Estimate the subsystems' parameters and the wave-exciting force from a body's motion (section 3.2).

    Parameters
    ----------
    model : Model
        Start of the estimate: its memory is the prior mean.
    seed : int
        Of all randomness.
    preset : {None, "paper"}
        None: noise levels scaled to the record, noise carried by a covariance given the parameters. "paper": as
        printed, Q = R = 8.0739e-5 in non-dimensional units with motion in units of its standard deviation.
    points : mapping {omega: K} or sequence of omega, optional
        Frequencies [rad/s] at which K is known (25)-(27); from the model's data where only frequencies are given.
    point_noise : float
        Relative error of the known K.
    prior : float or array_like, shape (n_theta,)
        Relative standard deviation of the parameters; 0 keeps one fixed. Lognormal with the model's values as median
        (the paper's: normal).
    n_ensemble : int
    noise : mapping of str to float, optional
        Sensor noise by channel (`Heave_acceleration`: m/s^2, ...), standard deviation; from the record if absent.
    force_model : {"coloured", "persistence"} or ForceModel
        How the unknown force moves (default filter only; the paper's is persistence (19)).
    learn : {"known-force", "always", "never"}
        When motion may move the parameters. Under an unknown force it tells nothing about them, and a filter that
        thinks otherwise takes its force model for knowledge; "always" lets it.
    analysis : {"stochastic", "square-root"}
        Of the paper's ensembles: perturbed observations (34) or none.
    draws : {"gaussian", "three-point"}
        Noise of the paper's ensembles: Gaussian, or three points that match five of its moments, faster.
    inflation : float
        Factor on the spread of the paper's state and parameters after each analysis; 1 is none.
    entries : sequence of (str, str), optional
        Entries of the radiation matrix to estimate; all by default.
    gate : float
        Samples farther off than this many standard deviations are refused as spikes (default filter).
    omega : array_like, optional
        Frequencies [rad/s] of the answer.
    units : (float, float), optional
        Mass [kg] and time [s] units of the paper's preset: rho b^2 times the length, and sqrt(b/g), for a section of
        half-breadth b (A.4)-(A.6). By default those that give the first degree of freedom's M + A_inf, and the
        stiffest one's frequency, the size they have in the paper.

    Raises
    ------
    InputError
        On settings that are not usable.
    """

    def __init__(self, model: Model, *, seed: int = 0, preset: str | None = None, points: Points | None = None,
                 point_noise: float = 1e-3, prior: ArrayLike = 0.15, n_ensemble: int = 100,
                 noise: Mapping[str, float] | None = None, force_model: str | ForceModel = "coloured",
                 learn: str = "known-force", analysis: str = "stochastic", draws: str = "gaussian",
                 inflation: float = 1.0,
                 entries: Sequence[tuple[str, str]] | None = None, gate: float = 6.0,
                 omega: ArrayLike | None = None, units: tuple[float, float] | None = None) -> None:
        for name, value, allowed in (("preset", preset, PRESETS), ("learn", learn, LEARN), ("draws", draws, DRAWS),
                                     ("analysis", analysis, ("stochastic", "square-root"))):
            choice(name, value, tuple(allowed))
        if not inflation > 0.0:
            raise InputError(f"inflation: {inflation:g}; a positive factor is needed")
        if n_ensemble < 4:
            raise InputError(f"n_ensemble: {n_ensemble}; at least 4 members are needed for a covariance")
        if isinstance(force_model, str) and force_model not in ("coloured", "persistence"):
            raise InputError(f"force_model: {force_model!r} is unknown; use 'coloured', 'persistence' or a ForceModel")
        self.model, self.seed, self.preset, self.noise = model, seed, preset, noise
        self.n_ensemble, self.force_model, self.learn, self.gate = n_ensemble, force_model, learn, gate
        self.analysis, self.draws, self.point_noise, self.inflation = analysis, draws, point_noise, inflation
        self.parts = subsystems(model.fit, entries)
        relative = np.broadcast_to(np.asarray(prior, dtype=float), self.parts.theta.shape)
        if np.any(relative < 0.0):
            raise InputError("prior: a relative standard deviation cannot be negative")
        self.prior_std = relative * np.abs(self.parts.theta)
        self.points = points_or_none(model, points)
        self.omega = frequencies_of(model) if omega is None else np.asarray(omega, dtype=float)
        self.units = paper_units(model) if units is None else units
        self.engine: Engine | None = None
        self._scales: Scales | None = None
        self.time = np.nan
        self._plan = plan_of(model, self.parts)

    def prepare(self, record: Record) -> DualEnKF:
        """Start afresh, with sensor noise and the force's size taken from a record; `step` may follow.

        Returns
        -------
        DualEnKF
            Itself.

        Raises
        ------
        InputError
            If a channel is missing or dead, or its unit contradicts another channel or the model.
        """
        check_units(self.model, [record])
        check_decays(self.model, [record])
        self._start(scales_of(record, self.model, self.parts, self.noise))
        return self

    def step(self, sample: Mapping[str, float]) -> Sample:
        """Take one sample of live data: `time` and whatever channels came; others count as missing.

        Raises
        ------
        InputError
            If `prepare` was not called, or time does not ascend.
        """
        if self.engine is None:
            raise InputError("step: call prepare(record) first, with a stretch of record to take the scales from")
        y = np.full((4 * self.model.n, 1), np.nan)
        for j, dof in enumerate(self.model.dofs):
            for i, suffix in enumerate(("", "_velocity", "_acceleration", "_force")):
                y[i * self.model.n + j, 0] = sample.get(dof + suffix, np.nan)
        time = float(sample["time"])
        out = self.advance(np.array([time]), y)
        return Sample(time, out.force[0], out.force_std[0], out.theta[0], out.theta_std[0], float(out.nis[0]),
                      int(out.used[0]))

    def run(self, record: Record, *, smooth: bool = False) -> Estimate:
        """Filter a whole record.

        Parameters
        ----------
        record : Record
        smooth : bool
            Give the force by all of the record instead of by its past (default filter).

        Raises
        ------
        InputError
            If the record lacks what the model needs.
        SolverError
            If the filter diverges.
        """
        self.prepare(record)
        y = channels(record, self.model.dofs)
        if not smooth:
            return self._estimate(record, self._settled(self.advance(record.time, y)), int(np.isfinite(y).sum()))
        if not isinstance(self.engine, MarginalEngine):
            raise InputError("smooth: only the default filter has a smoother")
        first = self.engine.cloud.P.copy()
        estimate = self._estimate(record, self._settled(self.advance(record.time, y)), int(np.isfinite(y).sum()))
        dts = np.diff(record.time, prepend=record.time[0])
        return replace(estimate, force=smoothed_force(self.engine, first, y.T, dts, self._steps(dts)))

    def settle(self) -> tuple[FloatArray, FloatArray]:
        """Learn again from all samples since the start, up to 65536, with the parameters as they are known now.

        `run` ends with it; with live samples it happens by itself whenever their number has doubled. Default filter.

        Returns
        -------
        tuple of ndarray, ndarray
            Parameters and their standard deviation, each (n_theta,).
        """
        if not isinstance(self.engine, MarginalEngine):
            raise InputError("settle: only the default filter takes samples again; call prepare(record) first")
        return self.engine.settle()

    def _settled(self, out: Outcome) -> Outcome:
        if isinstance(self.engine, MarginalEngine):
            out.theta[-1], out.theta_std[-1] = self.engine.settle()
        return out

    def _steps(self, dts: FloatArray) -> np.ndarray:
        return np.ceil(dts / self.longest - 1e-9).astype(np.int64)

    def save(self, path: str | Path) -> None:
        """Write the running filter to a file; `load` goes on from there with the same numbers to the last bit."""
        if self.engine is None or self._scales is None:
            raise InputError("save: nothing to save yet; call prepare(record) or run(record) first")
        settings = {key: getattr(self, key) for key in ("seed", "preset", "point_noise", "n_ensemble", "learn",
                                                        "analysis", "draws", "inflation", "gate", "units", "longest")}
        settings["force_model"] = self.force_model if isinstance(self.force_model, str) else self.force_model.name
        force = self._force_model(self._scales)
        state = {"time": self.time, "prior_std": self.prior_std, "omega": self.omega, "points": self.points[0],
                 "points_K": self.points[1], "entries": np.array(self.parts.entries),
                 **{f"scales_{f.name}": getattr(self._scales, f.name) for f in fields(Scales)},
                 **{f"force_{k}": getattr(force, k) for k in ("A", "q", "start")}, **self.engine.arrays()}
        write(path, settings, self.model, state)

    @classmethod
    def load(cls, path: str | Path) -> DualEnKF:
        """Return a filter saved by `save`, ready for the next `step`.

        Raises
        ------
        InputError
            If the file is not a saved filter.
        """
        settings, model, state = read(path)
        force = ForceModel(state["force_A"], state["force_q"], state["force_start"], settings["force_model"])
        filter_ = cls(model, seed=settings["seed"], preset=settings["preset"], point_noise=settings["point_noise"],
                      entries=[(model.dofs[j], model.dofs[k]) for j, k in state["entries"]],
                      points=dict(zip(state["points"].tolist(), state["points_K"])) or None,
                      n_ensemble=settings["n_ensemble"], force_model=force, learn=settings["learn"],
                      analysis=settings["analysis"], draws=settings["draws"],
                      inflation=settings["inflation"], gate=settings["gate"],
                      units=tuple(settings["units"]), omega=state["omega"])
        filter_.prior_std = state["prior_std"]
        filter_._start(Scales(*(state[f"scales_{f.name}"] for f in fields(Scales))))
        assert filter_.engine is not None
        filter_.engine.restore(state)
        filter_.time, filter_.longest = float(state["time"]), settings["longest"]
        return filter_

    def advance(self, time: FloatArray, y: FloatArray) -> Outcome:
        """Take many samples at once: time (nt,) and channels (4 n, nt) as `scales.channels` stacks them.

        A long record can be taken in pieces; the state between them is the same to the last bit.

        Raises
        ------
        InputError
            If time does not ascend.
        SolverError
            If the filter diverges.
        """
        if self.engine is None:
            raise InputError("advance: call prepare(record) first")
        dts = np.diff(time, prepend=time[0] if np.isnan(self.time) else self.time)
        if not dts.min() >= 0.0:
            at = int(np.argmin(dts))
            raise InputError(f"time: {time[at]:g} s comes after a later sample; samples must be in order")
        out = self.engine.advance(np.ascontiguousarray(y.T), dts, self._steps(dts))
        if not (np.isfinite(out.theta[-1]).all() and np.isfinite(out.force[-1]).all()):
            at = int(np.argmin(np.isfinite(out.force).all(axis=1) & np.isfinite(out.theta).all(axis=1)))
            raise SolverError(f"the filter diverged at {time[at]:g} s: its members are no longer finite")
        self.time = float(time[-1])
        return out

    def _start(self, scales: Scales) -> None:
        self._scales, self.time = scales, np.nan
        prior, loop = np.random.SeedSequence(self.seed).spawn(2)
        rng = np.random.default_rng(prior)
        if self.preset is None:
            drawn = drawing(self.parts, self.prior_std, self.points, self.point_noise, self.omega, self.n_ensemble, rng)
            self.engine = MarginalEngine(self._plan, drawn, scales, self._force_model(scales), self.gate, self.learn)
            theta = self.engine.cloud.theta
        else:
            members = gaussian_members(self.parts, self.prior_std, self.n_ensemble, rng)
            self.engine = self._printed(members, scales, seeded(loop))
            theta = np.column_stack([members.theta, self.parts.theta])
        self.longest = substeps(self.parts, self.model, theta.T)

    def _force_model(self, scales: Scales) -> ForceModel:
        if isinstance(self.force_model, ForceModel):
            return self.force_model
        if self.force_model == "persistence":
            return persistence(scales.force, scales.omega)
        return coloured(scales.force, scales.omega, scales.bandwidth)

    def _printed(self, members: Members, scales: Scales, state: np.ndarray) -> PrintedEngine:
        n, sizes = self.model.n, (self.parts.theta.size, self._plan.m + 2 * self.model.n)
        units = Units(scales.motion, *self.units)
        H, y, scale = rows(self.parts, *self.points)
        # A row is worth |K P|; in units of that its two parts are numbers of order one.
        H, y = H * units.parameters(self._plan) / scale[:, None], y / scale
        noise = Noise(*(np.full(k, np.sqrt(PAPER_VARIANCE)) for k in (*sizes, n, 2 * n + y.size, n)))
        return PrintedEngine(self._plan, members, noise, Constraint(H, y), units, state,
                             self.analysis == "stochastic", self.draws, self.inflation)

    def _estimate(self, record: Record, out: Outcome, there: int) -> Estimate:
        assert self.engine is not None
        parts, points = self.parts, self.points[0].size > 0
        members, repairs = self.engine.kept()
        K, A, B = coefficient_bands(parts, out.theta[-1], members, self.omega, self.model.A_inf)
        counts = {**repairs, "refused": there - int(out.used.sum()) if self.preset is None else 0,
                  "not_passive": int((~parts.passive(members.T, self.omega)).sum()),
                  "not_stable": int((~parts.stable(members.T)).sum())}
        table = parameter_table(parts.names, out.theta[-1], self.engine.drawn(), parts.theta, self.prior_std)
        force, reach = out.force.T, Z95 * out.force_std.T
        start = {"theta": parts.theta, "K": parts.K(parts.theta, self.omega),
                 "force": out.baseline.T if self.preset is None else self._doing_nothing(record)}
        return Estimate(self.model.dofs, record.time, parts.names, out.theta.T, out.theta_std.T, members, parts,
                        self.omega, K, A, B, Band(force, force - reach, force + reach), table, start, out.nis, out.used,
                        counts, doubts(self.model, record)
                        + warnings_of(table, counts, record, self.model.dofs, points, self.preset))

    def _doing_nothing(self, record: Record) -> FloatArray:
        idle = DualEnKF(self.model, prior=0.0, n_ensemble=4, noise=self.noise, learn="never", omega=self.omega)
        return idle.run(record).force.mean
