"""How much motion alone can tell of K at most: van Trees' bound of the pooled ratio in a JONSWAP sea.

OMP_NUM_THREADS=1 python benchmarks/identify_bound.py [--seeds 5] [--write]

Expected error of K over that of the prior model, root mean square, from the Fisher information of the motion's spectrum
(Whittle) with the prior's: what no estimator of this model passes on average. Displacement, noise of 1 %. `These
truths`: what the linear estimator of that prior is expected to reach on the very bodies of the table; it is their
distance from the model that the ratio is taken by.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import identify_truth as truth
from identify import OWN
from validation import publish, table

from radiation_ss.identification.channels import motion_channels
from radiation_ss.identification.sea import SeaModel
from radiation_ss.identification.spectral import spectral_likelihood
from radiation_ss.identification.study import with_body_held
from radiation_ss.inference.prior import parametrise

# what is unknown of the sea: family, number of its parameters that are
SEAS = {"sea known": ("one system", 0), "Hs, Tp, gamma unknown": ("one system", 3),
        "smooth departure": ("departing", -1)}


def bounds(length, rng, tolerance):
    """Return the squared bound for each of SEAS on one record; squared errors expected of this body, and before."""
    body = truth.lewis_heave()
    model = truth.perturbed(body, rng)
    record, _ = truth.sail(body, truth.any_jonswap(rng), length, rng)
    form = parametrise(model.fit, model.A_inf, 0.15).with_nominal(
        dict.fromkeys(("mass", "A_inf", "stiffness"), tolerance) | {"sensor": 0.0, "force": 0.0}, model.M)
    n, omega, out = form.size, body.band, []
    J = np.array([(form.K(form.theta(1e-4 * e), omega) - form.K(form.mean, omega)).ravel() / 1e-4 for e in np.eye(n)]).T
    part, _ = spectral_likelihood(model, form, motion_channels(model, record))
    at = with_body_held(part, np.zeros(n), np.zeros(part.size), 50).phi
    for family, unknown in SEAS.values():
        own = type(part)(model, form, part.channels, part.coefficients, SeaModel(
            part.sea.height, part.sea.period, part.sea.knots, family, edges=part.sea.edges), part.rules)
        v = np.r_[at[:3], np.zeros(own.sea.size - 3), at[-1]]
        fisher = own.local(np.zeros(n), v)[2]
        free = np.r_[0:n, n:n + (own.sea.size if unknown < 0 else unknown), n + own.size - 1]
        left = np.linalg.inv(fisher[np.ix_(free, free)] + np.eye(free.size))[:n, :n]
        out.append(np.sum(np.abs(J @ np.linalg.cholesky(left)) ** 2) / np.sum(np.abs(J) ** 2))
        if unknown == 3:        # with error e = left (noise - u) and information left^-1 - 1 in the noise
            away = (body.K(omega) - form.K(form.mean, omega)).ravel()
            real, size = np.r_[J.real, J.imag], 1e-3 * np.linalg.norm(away)
            u = np.linalg.solve(real.T @ real + size**2 * np.eye(n), real.T @ np.r_[away.real, away.imag])
            spread = left @ (np.linalg.inv(left) - np.eye(n)) @ left
            after = np.linalg.norm(J @ left @ u) ** 2 + np.trace(J @ spread @ J.conj().T).real
            expected = [after, np.linalg.norm(away) ** 2]
    return [*out, *expected]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=201)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--write", action="store_true", help="put the table into docs/validation/identify.md")
    args = parser.parse_args()
    rows = []
    for length in (30.0, 120.0, 600.0):
        for tolerance in (1e-6, 0.02):
            label = list(OWN).index(f"JONSWAP, {length:g} s")
            found = np.mean([bounds(length, np.random.default_rng([args.seed, seed, label]), tolerance)
                             for seed in range(args.seeds)], axis=0)
            rows.append([f"{length:g} s", "exact" if tolerance < 1e-3 else f"{tolerance:.0%}",
                         *(f"{value:.2f}" for value in np.sqrt(np.r_[found[:-2], found[-2] / found[-1]]))])
    publish("identify", args.write, bound=table(["record", "mass, A_inf, stiffness", *SEAS, "these truths"], rows))


if __name__ == "__main__":
    main()
