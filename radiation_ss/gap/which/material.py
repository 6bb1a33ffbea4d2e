"""What a fit leaves: the gap above the noise, and pulls that tolerances do not explain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from radiation_ss.gap.posterior.evidence import within_bounds
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.noise import mean_square
from radiation_ss.gap.posterior.red_noise import noise_with_drift
from radiation_ss.gap.posterior.setting import Term

MATERIAL = 0.005  # an effect must close this much of the motion, or bring the nominal numbers back
HOME = 6.0  # by this much of what their pulls cost,
SPRUNG = 5.0  # tolerances; nobody who says 2 % means 10 %
HALF = 0.5  # of an energy, or of pulls beyond what is usual: what leaves more than it explains is no cause
ODD = 0.01  # where pulls are such as tolerances give with less than this probability


def gap_left(found: Fit, floors: tuple[float, ...]) -> float:
    """Return the relative residual above the noise that a fit leaves on its own records."""
    channels = [c for item in found.problem.setting.records for c in item.channels]
    ratios = [max(mean_square(r) - floor**2, 0.0) / max(mean_square(c.value), 1e-300)
              for c, r, floor in zip(channels, found.point.residuals, floors)]
    return float(np.sqrt(np.mean(ratios)))


def not_white(found: Fit, floors: tuple[float, ...]) -> float:
    """Return the relative size of noise that is not white in what a fit leaves."""
    whole, rest = gap_left(found, floors), gap_left(found, noise_with_drift(found, floors))
    return float(np.sqrt(max(whole**2 - rest**2, 0.0)))


def open_case(found: Fit, floors: tuple[float, ...]) -> bool:
    """Whether an effect could still matter: something is left above the noise, or nominal numbers are pulled."""
    return gap_left(found, floors) > MATERIAL or out_of_tolerance(found)


def pulled(found: Fit, *, named: bool = False) -> float:
    """Return what the pulls cost: the sum of their squares, and twice the log evidence that bounds take away.

    Of all that the tolerances leave free, or of the nominal numbers only.
    """
    return squares(found, named=named) + 2.0 * max(-within_bounds(found), 0.0)


def squares(found: Fit, *, named: bool) -> float:
    """Return the sum of the squared pulls."""
    return float(np.sum(found.q[within_tolerance(found, named=named)] ** 2))


def out_of_tolerance(found: Fit, *, named: bool = False) -> bool:
    """Whether pulls are larger than tolerances explain: of the nominal numbers or, unless only they are asked, of all.

    Many small pulls of the discrepancy do not make up for a few large ones of nominal numbers. Where all numbers keep
    to their bounds, evidence loses as much as here by them once in 1 / ODD cases at most.
    """
    return (within_bounds(found) < np.log(ODD) or too_far(found, named=True)
            or (not named and too_far(found, named=False)))


def too_far(found: Fit, *, named: bool) -> bool:
    """Whether the pulls together, or the largest alone, are larger than a normal prior explains.

    Of the numbers that the records inform the pulls are standard normal, those of the others stay at zero: the sum of
    squares is chi-squared with as many degrees of freedom as the records inform. One number alone may be as far off as
    the largest of so many.
    """
    free, informed = within_tolerance(found, named=named), expected(found, named=named)
    alone = float(norm.isf(0.5 * ODD / max(informed, 1.0)))
    return (squares(found, named=named) > max(HOME, float(chi2.isf(ODD, max(informed, 1e-3))))
            or bool(np.any(np.abs(found.q[free]) > alone)))


def sprung(found: Fit) -> bool:
    """Whether a nominal number has moved so far that what is retuned is no longer the model with its tolerance."""
    return bool(np.any(np.abs(found.q[: len(found.problem.setting.nominal)]) > SPRUNG))


def expected(found: Fit, *, named: bool) -> float:
    """Return the sum of squared pulls to be expected: how many numbers the records inform."""
    return float(np.sum(1.0 - np.diag(found.covariance)[within_tolerance(found, named=named)]))


def unusual(found: Fit, *, named: bool) -> float:
    """Return by how much the pulls cost more than expected."""
    return max(pulled(found, named=named) - expected(found, named=named), 0.0)


def imitable(found: Fit, terms: Sequence[Term]) -> bool:
    """Whether the nominal numbers could imitate these effects: half of what they change in the readings, at least.

    Only such effects have a claim on pulls. Others, of a free frequency say, may follow noise beside numbers that move
    from one optimum to another.
    """
    _, J = found.whitened()
    numbers = J[:, : len(found.problem.setting.nominal)]
    places = [k for k, term in enumerate(found.problem.terms) if term.key in {t.key for t in terms}]
    columns = [c for k in places for c in found.problem.columns(k)]
    change = J[:, columns] @ found.q[columns]
    left = change - numbers @ np.linalg.lstsq(numbers, change, rcond=None)[0]
    return bool(left @ left < HALF * (change @ change))


def within_tolerance(found: Fit, *, named: bool = False) -> NDArray[np.intp]:
    """Return the positions in q of nominal numbers and, unless only named ones are wanted, of the discrepancy."""
    setting = found.problem.setting
    unnamed = 0 if named else setting.unnamed
    return np.concatenate([np.arange(len(setting.nominal)), np.arange(found.q.size - unnamed, found.q.size)])
