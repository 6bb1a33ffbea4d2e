"""Motion only: likelihood of the motion's spectrum under an unknown sea and Haskind's relation."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.identification.banded import Coefficients
from radiation_ss.identification.channels import Channels
from radiation_ss.identification.haskind import Haskind, RelativeErrors, motion_slopes, receptance_times_X, relation
from radiation_ss.identification.sea import SeaModel, families
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.records.signals import filled, stretches


@dataclass(frozen=True, eq=False)
class SpectralRules:
    """What decides how a record is read."""

    # lowest, highest: Widest band used, relative to the motion's median frequency
    lowest: float = 0.4
    highest: float = 2.5
    # power, strong: Shares of the largest spectral density of the motion: below `power` a frequency at either end of
    # the band is not used (there the window's leakage, and what no model knows of a spectrum's tail, outweigh the
    # body); above `strong` it has power enough to speak of the body
    power: float = 1e-5
    strong: float = 1e-2
    # noise, noise_spread: Prior median of measurement noise over the motion's rms; spread of its logarithm
    noise: float = 0.01
    noise_spread: float = 1.5
    # unexplained, unexplained_spread: Of several degrees of freedom: prior median of the share of each motion's
    # variance that one long-crested sea and smooth errors of X do not explain; spread of its logarithm
    unexplained: float = 0.01
    unexplained_spread: float = 1.5
    least_unexplained: float = 2.5e-3  # Its least value: errors of X of 5 % that are not smooth leave 0.0025
    # knot_spacing, knots: Distance of the sea's knots in log w, and their least and largest number
    knot_spacing: float = 0.22
    knots: tuple[int, int] = (4, 9)
    # bridge, gap_reach, shortest: In periods of the motion: longest gap that is filled, how far around it is looked,
    # shortest stretch
    bridge: float = 0.5
    gap_reach: float = 1.5
    shortest: float = 4.0
    longest: float = 400.0  # Periods; a longer stretch is cut into equal ones that are taken as independent

    def windowed(self, y: FloatArray, channels: Channels) -> Coefficients:
        """Return the Fourier coefficients in the widest band of stretches (m, nt, p), over each channel's rms."""
        spacing = 2.0 * np.pi / (y.shape[1] * channels.dt)
        first = max(int(np.ceil(self.lowest * channels.frequency / spacing)), 2)
        last = int(min(self.highest * channels.frequency, 0.8 * np.pi / channels.dt) / spacing)
        part = Coefficients(y / channels.rms, channels.dt, first, last)
        return replace(part, last=max(last, first + 2 * part.reach + 2))


@dataclass(frozen=True, eq=False)
class SpectralLikelihood:
    """log p(motion | u, sea, noise) of one record, by its windowed Fourier coefficients where the motion has power.

    Nuisance parameters v: the sea's; of several channels the share that it leaves unexplained, and the errors of log X
    of one degree of freedom against the others; log noise of each.
    """

    model: Model
    form: Parametrisation
    channels: Channels
    coefficients: tuple[Coefficients, ...]
    sea: SeaModel
    rules: SpectralRules
    force_error: float = 0.0  # Standard deviation of the errors of log X, which are smooth in frequency

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return self.place.stop + self.channels.count

    @cached_property
    def errors(self) -> RelativeErrors:
        """The errors of X."""
        return RelativeErrors.of(self.model.n, np.unique(self.channels.dof), self.force_error, self.channels.frequency)

    @property
    def place(self) -> slice:
        """Where the errors of X stand in v."""
        first = self.sea.size + (self.channels.count > 1)
        return slice(first, first + self.errors.size)

    def with_errors(self, v: FloatArray, haskind: Haskind, omega: FloatArray) -> Haskind:
        """Return Haskind's relation at omega [rad/s] with the errors of X."""
        return self.errors.applied(v[self.place], haskind, omega)

    @property
    def families(self) -> tuple[str, ...]:
        """Families of seas that compete, the first the one that climbs start with.

        Of several motions, whose ratio tells of the body in any sea, fewer, and none that is exact: the level of its
        spectrum would follow what is unexplained, which is not the same share at all frequencies, and the body with it.
        """
        return tuple(families()) if self.channels.count == 1 else ("departing", "free")

    @cached_property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency [rad/s] at which the motion has power."""
        strong = [part.with_power(self.rules.strong).omega for part in self.coefficients]
        return min(float(omega[0]) for omega in strong), max(float(omega[-1]) for omega in strong)

    @cached_property
    def haskind(self) -> tuple[Haskind, ...]:
        """Haskind's relation at each stretch's frequencies."""
        return tuple(relation(self.model, self.form, part.positive)[0] for part in self.coefficients)

    @cached_property
    def _factors(self) -> tuple[ComplexArray, ...]:
        """For each stretch the channels' derivative factors (nw, p), in units of each channel's rms."""
        return tuple(np.asarray((1j * part.positive[:, None]) ** self.channels.derivative / self.channels.rms,
                                dtype=np.complex128) for part in self.coefficients)

    def responses(self, number: int, u: FloatArray, v: FloatArray) -> ComplexArray:
        """Return channels per wave amplitude, in units of each channel's rms, shape (..., nw, p)."""
        w = self.coefficients[number].positive
        motion = receptance_times_X(self.model, self.form, u, w, self.with_errors(v, self.haskind[number], w))[1]
        return np.asarray(motion[..., self.channels.dof] * self._factors[number])

    def spectra(self, number: int, u: FloatArray, v: FloatArray) -> ComplexArray:
        """Return cross spectra of the channels, shape (..., nw, p, p), of u (..., n_u) and one v."""
        g = self.responses(number, u, v)
        S = self.sea.density(v[:self.sea.size], self.coefficients[number].fine)
        if self.channels.count == 1:
            return np.asarray((np.abs(g[..., 0]) ** 2 * S)[..., None, None])
        cross = g[..., :, None] * np.conj(g[..., None, :]) * S[..., None, None]
        diagonal = range(self.channels.count)
        cross[..., diagonal, diagonal] *= 1.0 + self.unexplained(v)
        return np.asarray(cross)

    def _slopes(self, number: int, u: FloatArray, v: FloatArray, S: ComplexArray,
                body: bool) -> Iterator[tuple[slice, ComplexArray]]:
        """Yield the derivatives (m, nw, p, p) of `spectra` S by some parameters of [u, v], and which these are."""
        share, n, end = self.unexplained(v), u.size * body, self.sea.size
        own, density = np.eye(self.channels.count), self.sea.density(v[:end], self.coefficients[number].fine)
        w, dof, factor = self.coefficients[number].positive, self.channels.dof, self._factors[number]
        haskind, slopes = self.with_errors(v, self.haskind[number], w), None
        if body:
            motion, slopes = motion_slopes(self.model, self.form, u, w, haskind)
        else:
            motion = receptance_times_X(self.model, self.form, u, w, haskind)[1]
        other = np.conj(motion[:, dof] * factor)[:, None, :]

        def cross(some: ComplexArray) -> ComplexArray:
            half = (some[..., dof] * factor * density[:, None])[..., None] * other
            both = (half + np.conj(half.swapaxes(-1, -2))) * (1.0 + share * own)
            return np.asarray(both if self.channels.count > 1 else both.real)

        for rows, some in slopes or ():
            yield rows, cross(some)
        if self.errors.size:
            alone = np.stack([receptance_times_X(self.model, self.form, u, w, replace(haskind, X=haskind.X * only))[1]
                              for only in np.eye(self.model.n)])
            yield slice(n + self.place.start, n + self.place.stop), cross(self.errors.slopes(alone, w))
        yield slice(n, n + end), self.sea.log_slopes(v[:end], self.coefficients[number].fine)[:, :, None, None] * S
        if self.channels.count > 1:
            least = self.rules.least_unexplained
            size = self.rules.unexplained_spread * (share - least) / (1.0 + share)
            yield slice(n + end, n + end + 1), (size * S * own)[None]

    def unexplained(self, v: FloatArray) -> float:
        """Return the share of each motion's spectrum that the sea does not explain; 0 of one channel."""
        if self.channels.count == 1:
            return 0.0
        rules = self.rules
        return float(rules.least_unexplained + rules.unexplained * np.exp(rules.unexplained_spread * v[self.sea.size]))

    def noise(self, v: FloatArray) -> FloatArray:
        """Return measurement noise variances over each channel's variance, shape (..., p)."""
        size = self.rules.noise_spread * v[..., self.size - self.channels.count:]
        return np.asarray((self.rules.noise * np.exp(size)) ** 2)

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood."""
        noise = self.noise(v)
        return sum(part.log_likelihood(self.spectra(i, u, v), noise) for i, part in enumerate(self.coefficients))

    def local(self, u: FloatArray, v: FloatArray, body: bool = True) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, its exact gradient, and Whittle's Fisher information, in [u, v]; in v without body."""
        noise, p, n = self.noise(v), self.channels.count, u.size if body else 0
        d = n + v.size
        by_log_noise = 2.0 * self.rules.noise_spread * noise
        value, gradient, fisher = 0.0, np.zeros(d), np.zeros((d, d))
        for i, part in enumerate(self.coefficients):
            S = self.spectra(i, u, v)
            one, by_S, by_noise = part.gradient(S, noise)
            value += one
            gradient[d - p:] += by_log_noise * by_noise
            change = np.zeros((d, part.omega.size, p, p), dtype=S.dtype)
            for rows, slope in self._slopes(i, u, v, S, body):
                gradient[rows] += np.einsum("wij,awij->a", by_S, slope).real
                change[rows] = part.local_average(slope)
            seen = part.local_average(S) + np.diag(noise)
            change[range(d - p, d), :, range(p), range(p)] = by_log_noise[:, None]
            relative = np.linalg.inv(seen) @ change.transpose(1, 2, 0, 3).reshape(-1, p, d * p)
            relative = relative.reshape(-1, p, d, p)
            left, right = (relative.transpose(order).reshape(d, -1) for order in ((2, 0, 1, 3), (2, 0, 3, 1)))
            fisher += len(part.z) * (left @ right.T).real
        return value, gradient, fisher


def spectral_likelihood(model: Model, form: Parametrisation, channels: Channels, force_error: float = 0.0, *,
                        rules: SpectralRules = SpectralRules()) -> tuple[SpectralLikelihood, tuple[str, ...]]:
    """Return the likelihood of one record's motion, and warnings.

    Of each degree of freedom displacement, else velocity, else acceleration. Gaps longer than half a period split the
    record into stretches that are taken as independent; shorter ones are filled.
    """
    channels = channels.one_each()
    w_mid, period = channels.frequency, channels.period / channels.dt
    y = np.stack([filled(column, int(rules.bridge * period), int(rules.gap_reach * period))
                  for column in channels.y.T], axis=1)
    whole = []
    for first, end in stretches(np.asarray(np.isfinite(y).all(axis=1))):
        if end - first >= rules.shortest * period:  # a long one in equal parts, without their means
            count = int(np.ceil((end - first) / (rules.longest * period)))
            part = y[first:first + (end - first) // count * count].reshape(count, -1, y.shape[1])
            whole.append(part - part.mean(axis=1, keepdims=True))
    if not whole:
        raise InputError(f"record {channels.name}: no stretch without gaps is longer than {rules.shortest:g} periods "
                         "of the motion")
    parts = tuple(rules.windowed(part, channels).with_power(rules.power) for part in whole)
    ends = min(part.omega[0] for part in parts), max(part.omega[-1] for part in parts)
    count = int(np.clip(round(np.log(ends[1] / ends[0]) / rules.knot_spacing) + 1, *rules.knots))
    sea = SeaModel(1.0, 2.0 * np.pi / w_mid, np.geomspace(*ends, count))
    likelihood = SpectralLikelihood(model, form, channels, parts, sea, rules, force_error)
    likelihood = replace(likelihood, sea=replace(sea, edges=likelihood.band))
    sea = replace(_first_guess(likelihood), name=likelihood.families[0])
    return replace(likelihood, sea=sea), relation(model, form, parts[0].omega)[1]


def _first_guess(likelihood: SpectralLikelihood) -> SeaModel:
    """Return the sea with Hs [m], Tp [s], level from the motion by the prior mean's response, on a grid of periods."""
    part, sea = max(likelihood.coefficients, key=lambda item: item.y.size), likelihood.sea
    g = np.abs(likelihood.responses(likelihood.coefficients.index(part), np.zeros(likelihood.form.size),
                                    np.zeros(likelihood.size))) ** 2

    def seen(S: FloatArray) -> FloatArray:
        return part.local_average((g.T * S).astype(complex)[:, :, None, None])[:, :, 0, 0].T.real

    best = (-np.inf, sea)
    power = np.mean(np.abs(part.z) ** 2, axis=0)
    for period in likelihood.channels.period * np.geomspace(0.6, 1.8, 25):
        unit = seen(replace(sea, height=1.0, period=float(period)).density(np.zeros(sea.size), part.fine))
        floor = 1e-4 * unit.max(axis=0)
        scale = float(np.mean(power / (unit + floor) * unit / unit.sum(axis=0)) * unit.shape[0])
        score = -float(np.sum(np.log(scale * (unit + floor)) + power / (scale * (unit + floor))))
        if score > best[0]:
            best = (score, replace(sea, height=float(np.sqrt(scale)), period=float(period)))
    inside = (part.omega >= sea.edges[0]) & (part.omega <= sea.edges[1])
    # The mean of the log of an exponential variable is -0.577.
    ratio = np.mean(np.abs(part.z) ** 2, axis=2) / seen(np.ones(part.fine.size)).mean(axis=1)
    return replace(best[1], level=float(np.mean(np.log(ratio + 1e-300)[:, inside]) + np.euler_gamma))
