"""Values that no causal body has: a wrong entry or sample leaves what is right alone, and what is right is kept."""

import numpy as np
import pytest
from fit_systems import data_of, random_passive
from seeds import some

import radiation_ss as rss

OMEGA = np.linspace(0.05, 8.0, 160)


def off(fit, truth, i):
    """Return the relative error of an entry of the diagonal against the true system."""
    K = fit.frequency_response(truth.omega)
    return np.linalg.norm(K[:, i, i] - truth.K[:, i, i]) / np.linalg.norm(truth.K[:, i, i])


@pytest.mark.parametrize("seed", some([0, 2, 3, 4]))
def test_a_coupling_without_its_damping_leaves_the_motions_alone(seed):
    """As public files have it: the coupling's B is zero by a mistaken symmetry, its added mass is there."""
    truth = data_of(*random_passive(4, 2, seed), omega=OMEGA, dofs=("Surge", "Pitch"))
    B = truth.B * np.eye(2)
    fit = rss.fit_radiation(truth.replace(B=B), 4)
    assert max(off(fit, truth, 0), off(fit, truth, 1)) < 0.06
    assert {"not causal"} >= {s.kind for s in fit.suspects}


@pytest.mark.parametrize("seed", some([0, 1, 2, 3]))
def test_a_motion_whose_file_has_wrong_values_is_followed_elsewhere(seed):
    """One of them is 25 times as large as all else: it is not what the motion is measured by."""
    truth = data_of(*random_passive(4, 2, seed), omega=OMEGA, dofs=("Heave", "Roll"))
    A, B, wrong = truth.A.copy(), truth.B.copy(), [60, 95, 130]
    size = np.abs(truth.K[:, 1, 1]).max()
    B[wrong, 1, 1] += np.array([25.0, 2.0, 0.3]) * size
    A[wrong, 1, 1] -= np.array([10.0, 1.0, 0.2]) * size / OMEGA[wrong]
    fit = rss.fit_radiation(truth.replace(A=A, B=B), 4)
    assert max(off(fit, truth, 0), off(fit, truth, 1)) < 0.06
    assert {OMEGA[k] for k in wrong} <= {s.omega for s in fit.suspects if s.kind == "spike"}


@pytest.mark.parametrize("width", [0.05, 0.1, 0.2])
def test_a_narrow_peak_of_the_body_is_none(width):
    """A resonance between columns, some samples wide, obeys Kramers-Kronig: it is fitted, listed nowhere, and stays."""
    a = np.array([[-0.8, 1.5, 0.0, 0.0], [-1.5, 0.0, 0.0, 0.0], [0.0, 0.0, -2.0 * width, 2.0], [0.0, 0.0, -2.0, 0.0]])
    b = np.array([[1.0], [0.0], [0.4], [0.0]])
    data = data_of(a, b, b.T, omega=OMEGA)
    fit = rss.fit_radiation(data, 4)
    assert not fit.suspects and fit.relative_error < 1e-3
    assert data.clean(spikes=True).omega.size == OMEGA.size


def test_weights_of_ones_own_are_no_fault_of_the_data():
    truth = data_of(*random_passive(4, 1, 0), omega=OMEGA)
    fit = rss.fit_radiation(truth, 4, weight=np.where(OMEGA < 2.0, 1.0, 0.01))
    assert not fit.suspects and not any("Kramers-Kronig" in note for note in fit.notes)
