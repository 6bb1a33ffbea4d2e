"""What `identify` claims over many seeds, and whether it holds: the tests try the first few of each.

    OMP_NUM_THREADS=1 python benchmarks/identify_seeds.py [study ...]

Ends with an error where a claim fails.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from identify_studies import contradicting, known_force, motion_alone, not_smooth, warned
from test_identify_coupled import coverage


def of_known_force():
    """The memory is found and its bands hold."""
    ratios, inside, moved, errors = known_force(range(6))
    # 6 runs of a few independent frequencies each: far below nine tenths would mean bands too narrow.
    return np.median(ratios) <= 0.12, np.mean(inside) > 0.75, np.mean(moved) > 0.5, errors.max() < 1.0


def of_rough_errors():
    """Errors of the model that are not smooth are no damper."""
    ratios, inside, damped = not_smooth(range(6))
    # Bands of 95 % of some three independent frequencies in each of six runs: a mean of .78 or less once in 100.
    return ratios.max() < 0.3, not damped.any(), np.mean(inside) > 0.78


def of_motion_alone():
    """Motion alone brings K and the force closer."""
    after, before, inside, force_inside, gained = motion_alone(range(5))
    # van Trees' bound of such records lies at 0.7 to 0.8
    return (np.linalg.norm(after) < 0.9 * np.linalg.norm(before), np.mean(inside) > 0.75, np.mean(force_inside) > 0.75,
            max(gained) > 0.2, min(gained) >= 0.0)


def of_the_prior():
    """Bodies of the prior are said to contradict it as seldom as one number would."""
    return (contradicting(range(16)).sum() <= 16 * 0.317,)  # P(|z| > 1)


def of_sound_records():
    """The chance of a warning on a sound record is set at 1e-4; here 8 x 3 runs."""
    return (not any(warned(seed) for seed in range(8)),)


def of_two_motions():
    """Bands hold the body where X is as exact as stated; an X that is taken as exact goes into the body."""
    exact, stated = coverage(range(3))
    return stated.mean() > 0.9, stated.min() > 0.6, exact.mean() < 0.8


STUDIES = {study.__name__: study for study in (of_known_force, of_rough_errors, of_motion_alone, of_the_prior,
                                               of_sound_records, of_two_motions)}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("studies", nargs="*", default=list(STUDIES), help=", ".join(STUDIES))
    held = []
    for name in parser.parse_args().studies:
        held.append(all(STUDIES[name]()))
        print(f"{'holds' if held[-1] else 'FAILS'}: {STUDIES[name].__doc__}", flush=True)
    return int(not all(held))


if __name__ == "__main__":
    sys.exit(main())
