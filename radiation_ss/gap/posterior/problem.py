"""The model under diagnosis as a least-squares problem with exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.effects import Active
from radiation_ss.errors import SolverError
from radiation_ss.gap.posterior.noise import Noise
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.simulation.reading import reading
from radiation_ss.simulation.rollout import Motion, Path, Rollout

LEAST_SHARE = -0.9  # of an inertia, a stiffness or a force by which it may change
UNBOUNDED = 1e100  # the square of a derivative must stay a number


@dataclass(frozen=True, eq=False)
class Point:
    """Residuals at one point of the parameter space.

    Parameters
    ----------
    residuals : list of ndarray
        Measured minus predicted for each channel of each record.
    slopes : list of ndarray, shape (nk, rolled), or None
        Derivatives of the prediction by all parameters but the discrepancy, which are `Setting.discrepancy`.
    paths : list of Path
        The motion in each record.
    """

    residuals: list[FloatArray]
    slopes: list[FloatArray] | None = None
    paths: Sequence[Path] = ()


class Problem:
    """Nominal numbers, effects and starts as one vector q of standard normal prior.

    Parameters
    ----------
    setting : Setting
    terms : sequence of Term
        Effects beside the nominal numbers.

    Attributes
    ----------
    size : int
        Length of q: nominal numbers, effects' parameters, then for each record its start and its own parameters, last
        the sizes of the discrepancy's directions.
    rolled : int
        How many of these the motion depends on: all but the discrepancy.
    """

    def __init__(self, setting: Setting, terms: tuple[Term, ...] = ()) -> None:
        self.setting, self.terms = setting, terms
        self.all_terms = (*setting.nominal, *terms)
        self.rollout = Rollout(setting.model, [term.active for term in self.all_terms], setting.h)
        self.base = np.array([v for term in self.all_terms for v in term.active.vector], dtype=float)
        self._layout()

    def _layout(self) -> None:
        shared: list[tuple[int, float, int, int]] = []  # position in p, spread, term, its parameter
        own: list[tuple[int, float, int, int]] = []
        self.where: dict[tuple[int, int], list[int]] = {}
        for k, term in enumerate(self.all_terms):
            for j in term.free:
                place = (int(self.rollout.offsets[k]) + j, term.spread[j], k, j)
                (own if term.active.effect.per_record else shared).append(place)
        columns = {(k, j): [c] for c, (_, _, k, j) in enumerate(shared)}
        at, self.blocks = len(shared), []
        kicks = self._kicks()
        width = [start.count + len(own) + len(kicks) for start in self.setting.starts]
        self.size = at + sum(width)
        self.maps, self.d_starts = [], []
        self.kicked: dict[tuple[tuple[str, str, str], int, int], int] = {}
        for r, start in enumerate(self.setting.starts):
            use = np.concatenate([np.arange(len(shared)), np.arange(at, at + width[r])])
            into = np.zeros((self.rollout.np, use.size))
            for c, (row, spread, _, _) in enumerate(shared):
                into[row, c] = spread
            for c, (row, spread, k, j) in enumerate(own):
                into[row, len(shared) + start.count + c] = spread
                columns.setdefault((k, j), []).append(at + start.count + c)
            begin = np.zeros((self.rollout.ns, use.size))
            begin[:, len(shared):len(shared) + start.count] = start.full(self.rollout.ns)
            for c, (row, spread, key) in enumerate(kicks, len(shared) + start.count + len(own)):
                begin[row, c] = spread
                self.kicked[*key, r] = int(use[c])
            self.blocks.append(use)
            self.maps.append(into)
            self.d_starts.append(begin)
            at += width[r]
        self.rolled = self.size
        self.size += self.setting.unnamed
        self.where = columns
        self.shared = len(shared)
        self.start_columns = [b[self.shared:self.shared + s.count] for b, s in zip(self.blocks, self.setting.starts)]

    def _kicks(self) -> list[tuple[int, float, tuple[tuple[str, str, str], int]]]:
        """Return row, standard deviation and name of each own state of an effect whose start is free."""
        found, at, setting = [], self.rollout.ns - self.rollout.own, self.setting
        for term in self.all_terms:
            effect = term.active.effect
            if effect.unrest is not None:
                sizes = effect.unrest(setting.scales[term.active.dof or setting.model.dofs[0]])
                found += [(at + k, float(size), (term.key, k)) for k, size in enumerate(sizes)]
            at += effect.states
        return found

    def columns(self, term: int) -> list[int]:
        """Return the positions in q of a term of `terms`, all records together."""
        k = len(self.setting.nominal) + term
        return [c for j in self.all_terms[k].free for c in self.where[k, j]]

    def limits(self) -> FloatArray:
        """Return the lower limit of each entry of q, -inf where there is none."""
        lower = np.full(self.size, -np.inf)
        for (k, j), places in self.where.items():
            if self.all_terms[k].signs[j] > 0:
                value, spread = self.base[self.rollout.offsets[k] + j], self.all_terms[k].spread[j]
                strength = j in self.all_terms[k].strengths
                lower[places] = (0.0 if strength else 0.05 * value) / spread - value / spread
        for k, number in enumerate(self.setting.nominal):
            if np.isfinite(number.bound) and not number.active.other:  # inertia, stiffness, force keep their sign
                lower[self.where[k, 0]] = LEAST_SHARE / number.spread[0]
        return lower

    def reach(self, q: FloatArray) -> FloatArray:
        """Return the lower limit of one step from q: half of a shape that cannot be negative, -inf for other entries.

        Along a motion with a wide friction or a long reach, slopes say nothing of a narrow or a short one.
        """
        lower = np.full(self.size, -np.inf)
        for (k, j), places in self.where.items():
            if self.all_terms[k].signs[j] > 0 and j not in self.all_terms[k].strengths:
                value, spread = self.base[self.rollout.offsets[k] + j], self.all_terms[k].spread[j]
                lower[places] = 0.5 * (q[places] - value / spread)
        return lower

    def parameters(self, q: FloatArray, record: int = 0) -> FloatArray:
        """Return the parameters in their own units for one record."""
        return self.base + self.maps[record] @ q[self.blocks[record]]

    def actives(self, q: FloatArray, record: int = 0) -> list[Active]:
        """Return nominal numbers and effects with the values of q."""
        p = self.parameters(q, record)
        offsets = self.rollout.offsets
        return [term.active.with_values(p[offsets[k]:offsets[k + 1]].tolist()) for k, term in enumerate(self.all_terms)]

    def motion(self, q: FloatArray, record: int) -> Motion:
        """Return the motion in one record at q, without derivatives."""
        prepared, p = self.setting.records[record], self.parameters(q, record)
        drive = self.rollout.drive(prepared, p)
        return self.rollout.run(self.d_starts[record] @ q[self.blocks[record]], drive, prepared.grid, p)

    def path(self, q: FloatArray, record: int) -> Path:
        """Return the motion in one record at q with its stages."""
        prepared, p = self.setting.records[record], self.parameters(q, record)
        drive = self.rollout.drive(prepared, p)
        return self.rollout.path(self.d_starts[record] @ q[self.blocks[record]], drive, prepared.grid, p)

    def at(self, q: FloatArray, *, slopes: bool = True, only: Sequence[int] | None = None,
           paths: Sequence[Path] | None = None) -> Point:
        """Return residuals and derivatives at q.

        Parameters
        ----------
        q : ndarray, shape (nq,)
        slopes : bool
            Whether derivatives are wanted.
        only : sequence of int, optional
            The entries of q by which, none of them of the discrepancy; all of these by default. The derivatives have
            one column for each of them.
        paths : sequence of Path, optional
            The motion in each record, where it is known.

        Raises
        ------
        SolverError
            If the motion or its derivatives grow without bounds.
        """
        wanted = np.arange(self.rolled) if only is None else np.asarray(only)
        residuals: list[FloatArray] = []
        derivatives: list[FloatArray] = []
        taken: list[Path] = []
        for r, prepared in enumerate(self.setting.records):
            p, use = self.parameters(q, r), self.blocks[r]
            drive = self.rollout.drive(prepared, p)
            start = self.d_starts[r] @ q[use]
            taken.append(paths[r] if paths else self.rollout.path(start, drive, prepared.grid, p))
            column, inside = np.nonzero(wanted[:, None] == use)
            into = self.maps[r][:, inside] if slopes else None
            motion = self.rollout.run(start, drive, prepared.grid, p, columns=into,
                                      d_start=self.d_starts[r][:, inside] if slopes else None,
                                      acceleration=any(c.quantity != "displacement" for c in prepared.channels),
                                      known=taken[r])
            for channel in prepared.channels:
                value, slope = reading(self.rollout, motion, prepared.grid, channel, p, into)
                k = len(residuals)
                residuals.append(self.setting.without_slow(k, channel.value - value - self.unnamed(q, k)))
                if slope is not None:
                    full = np.zeros((value.size, wanted.size))
                    full[:, column] = self.setting.without_slow(k, slope)
                    if not np.abs(full).max(initial=0.0) < UNBOUNDED:
                        raise SolverError("the derivatives of the motion grow without bounds")
                    derivatives.append(full)
        return Point(residuals, derivatives if slopes else None, taken)

    def unnamed(self, q: FloatArray, channel: int) -> FloatArray | float:
        """Return what tolerated errors add to a channel that no nominal number describes."""
        sizes = q[self.rolled:]
        return self.setting.discrepancy[channel] @ sizes if np.any(sizes) else 0.0

    def extend(self, q: FloatArray, old: Problem) -> FloatArray:
        """Return q of a problem with fewer terms as a start for this one: nominal numbers, known terms and starts."""
        new = np.zeros(self.size)
        known = {term.key: k for k, term in enumerate(old.all_terms)}
        for k, term in enumerate(self.all_terms):
            for j in term.free:
                if term.key in known and (known[term.key], j) in old.where:
                    new[self.where[k, j]] = q[old.where[known[term.key], j]]
        for name, place in self.kicked.items():
            if name in old.kicked:
                new[place] = q[old.kicked[name]]
        for mine, theirs in zip(self.start_columns, old.start_columns):
            if mine.size == theirs.size:  # a shorter stretch may need fewer directions of the memory
                new[mine] = q[theirs]
        count = self.setting.unnamed
        if count and count == old.setting.unnamed:
            new[-count:] = q[-count:]
        return new


def whitened(point: Point, noise: Noise) -> tuple[FloatArray, FloatArray | None]:
    """Return residuals and derivatives in units of the noise, all channels stacked."""
    r = np.concatenate([noise.whiten(i, value) for i, value in enumerate(point.residuals)])
    if point.slopes is None:
        return r, None
    return r, np.concatenate([noise.whiten(i, slope) for i, slope in enumerate(point.slopes)])
