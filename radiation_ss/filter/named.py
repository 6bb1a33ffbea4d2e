"""What a record teaches the named parameters of an uncertain plant.

Where the force is known, they learn from the whole record by Gauss-Newton steps on the innovations of the bank's
tangents, with the lognormal prior: .2 ms a sample. Samples that the gate refuses are taken out, and the rest is learned
from again.
"""

from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.filter import estimate
from radiation_ss.filter.bank import Bank, BankRun, PlantEstimate, UncertainPlant, bank_of, run_bank, smoothed_force
from radiation_ss.filter.estimate import Band
from radiation_ss.filter.members import exact_draws
from radiation_ss.filter.plan import start_covariance
from radiation_ss.filter.settings import FilterSettings, ForceModel, force_model_of
from radiation_ss.inference.laplace import Climb, Target, find_peak
from radiation_ss.inference.scales import channels, scales_of
from radiation_ss.inference.subsystems import subsystems_of
from radiation_ss.records.record import Record


class Learned(NamedTuple):
    """Standardised parameters by some samples, beside their prior."""

    u: FloatArray            # (d,)
    information: FloatArray  # (d, d)
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Teaching:
    """Banks of a plant at its standardised parameters u, with the force model, the noise and the start of a record."""

    plant: UncertainPlant
    time: FloatArray
    force: ForceModel
    noise: FloatArray  # (4, n)
    P: FloatArray

    def bank(self, u: FloatArray) -> Bank:
        """Return the bank at parameters (k, d)."""
        return bank_of([self.plant.own(row)[0] for row in self.plant.theta(u)], self.force, self.noise, self.P)

    @property
    def unlearned(self) -> Learned:
        """What is known before any sample."""
        d = self.plant.start.size
        return Learned(np.zeros(d), np.zeros((d, d)))

    def learned(self, y: FloatArray, passes: int = 30, near: float = 1e-4, settled: float = 0.1) -> Learned:
        """Learn from samples (nt, 4 n) where the force is known; SolverError if the parameters do not settle.

        At most `passes` damped Gauss-Newton steps, tangents `near` prior standard deviations apart, ended by one of
        `settled` posterior ones. Where the plant does not explain the samples, their information counts by
        `information_share`.
        """
        d, (u, information, _) = self.plant.start.size, self.unlearned
        if not np.isfinite(y[:, 3 * y.shape[1] // 4:]).all(axis=1).any():
            return self.unlearned

        @lru_cache(maxsize=1)
        def run(at: tuple[float, ...]) -> BankRun:
            with np.errstate(over="ignore", invalid="ignore"):   # a step too far may make the plant unstable
                return run_bank(self.bank(np.vstack([at + near * np.eye(d), at])), self.time, y, tangents=near)

        def local(u: FloatArray, _: FloatArray) -> tuple[float, FloatArray, FloatArray]:
            found = run(tuple(u.tolist()))
            there = np.isfinite(found.cost) and np.isfinite(found.information).all()
            return -0.5 * found.cost if there else -np.inf, found.gradient, found.information

        likelihood: Any = SimpleNamespace(size=0, value=lambda u, v: local(u, v)[0], local=local)
        target = Target(d, [likelihood], lambda rows: np.ones(rows.shape[0], dtype=bool))
        try:
            peak = find_peak(target, u, Climb(passes, settled**2))
        except SolverError:
            raise SolverError(f"the parameters {', '.join(self.plant.parameters)} do not settle in {passes} passes; "
                              "give better medians or smaller deviations") from None
        found = run(tuple(peak.phi.tolist()))
        share, doubts = estimate.information_share(found.nis, found.used)
        information = share * (peak.fisher - np.eye(d))
        u = peak.phi - (1.0 - share) * np.linalg.solve(np.eye(d) + information, peak.phi)
        return Learned(u, information, doubts)

    def gated(self, y: FloatArray, known: Learned, settings: FilterSettings, keep: bool) -> tuple[FloatArray, BankRun]:
        """Return members (k, d) drawn of what is known, and their run over samples, of which the gate refuses some."""
        d = known.u.size
        root = np.linalg.cholesky(np.linalg.inv(np.eye(d) + known.information))
        drawn = known.u + exact_draws(np.random.default_rng(settings.seed), d, settings.n_ensemble).T @ root.T
        return drawn, run_bank(self.bank(np.vstack([drawn, known.u])), self.time, y, gate=settings.gate, keep=keep)

    def taught(self, y: FloatArray, settings: FilterSettings, keep: bool,
               most: float = 0.1) -> tuple[Learned, FloatArray, BankRun]:
        """Return what is learned from the samples that its own members' run does not refuse, the members, and the run.

        Refused samples stay refused, so the passes end. Where more than the share `most` of all samples is refused, it
        is the plant that is wrong and not they: the last refused stay in. Parameters that do not settle stay at the
        prior as long as its run refuses samples.
        """
        there = left = int(np.isfinite(y).sum())
        while True:
            failed = None
            try:
                known = self.learned(y)
            except SolverError as error:
                known, failed = self.unlearned, error
            drawn, run = self.gated(y, known, settings, keep)
            before, left = left, int(run.taken.sum())
            if left == before or there - left > most * there:
                break
            y = np.where(run.taken, y, np.nan)
        if failed is not None:
            raise failed
        return known, drawn, run


def run_general(plant: UncertainPlant, record: Record, settings: FilterSettings, *,
                smooth: bool = False) -> PlantEstimate:
    """Filter a record on a plant with named uncertain parameters; settings: seed, n_ensemble, gate, noise."""
    nominal = plant.model(plant.start)
    scales = scales_of(record, nominal, subsystems_of(nominal.fit), settings.noise)
    force = force_model_of("coloured", scales.force, scales.omega, scales.bandwidth)
    # The plants' own states, not a Model's: of systems that differ a little these may differ much.
    P, y, T = start_covariance(nominal.fit, scales, force), channels(record, nominal.dofs).T, plant.own(plant.start)[1]
    P[:len(T), :len(T)] = T @ P[:len(T), :len(T)] @ T.T
    known, drawn, out = Teaching(plant, record.time, force, scales.noise, P).taught(y, settings, smooth)
    members = plant.theta(drawn).T
    table = estimate.parameter_table(tuple(plant.parameters), plant.theta(known.u), members, plant.start,
                                     plant.relative * np.abs(plant.start))
    counts = {"refused": int(np.isfinite(y).sum() - out.used.sum())}
    said = (*known.doubts, *estimate.warnings_of(table, counts, record, nominal.dofs, False, None))
    band = smoothed_force(out) if smooth else Band.normal(out.force.T, out.force_std.T)
    return PlantEstimate(nominal.dofs, record.time, band, table, members, out.nis, out.used, counts, said, plant)
