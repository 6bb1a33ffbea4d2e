"""Mass matrix against the kinetic energy of point masses, and laws of the composite for random bodies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_bodies import coupled_model

import radiation_ss as rss
from radiation_ss import mass_matrix
from radiation_ss.body import RIGID, system_matrices
from radiation_ss.hydro import velocity_transform
from radiation_ss.simulation import linear_response

seeds = st.integers(0, 2**31)


@settings(max_examples=30)
@given(seed=seeds)
def test_kinetic_energy_is_that_of_the_particles(seed):
    rng = np.random.default_rng(seed)
    m, r = rng.uniform(0.1, 2.0, 12), rng.standard_normal((12, 3))
    G, point = m @ r / m.sum(), rng.standard_normal(3)
    about_g = r - G
    tensor = np.sum(m[:, None, None] * (np.einsum("ki,ki->k", about_g, about_g)[:, None, None] * np.eye(3)
                                        - about_g[:, :, None] * about_g[:, None, :]), axis=0)
    M = mass_matrix(m.sum(), G, inertia=tensor, reference_point=point)
    v, turn = rng.standard_normal(3), rng.standard_normal(3)
    particles = v + np.cross(turn, r - point)
    motion = np.concatenate([v, turn])
    assert 0.5 * motion @ M @ motion == pytest.approx(0.5 * np.sum(m * np.sum(particles**2, axis=1)), rel=1e-10)
    # Moving the point is the congruence of the models.
    T = velocity_transform(RIGID, point - np.zeros(3))
    assert T.T @ M @ T == pytest.approx(mass_matrix(m.sum(), G, inertia=tensor), rel=1e-9, abs=1e-9)


def test_part_of_the_modes_and_gyradii():
    M = mass_matrix(10.0, (0.0, 0.0, -0.5), gyradii=(0.3, 0.4, 0.4), dofs=("b__Sway", "b__Roll"))
    assert M == pytest.approx(np.array([[10.0, 5.0], [5.0, 0.9 + 2.5]]))
    assert mass_matrix(3.0, (1.0, 2.0, 3.0), dofs=("Heave",)) == pytest.approx(np.array([[3.0]]))


@pytest.mark.parametrize("call, words", [
    (lambda: mass_matrix(0.0, (0, 0, 0)), "mass"),
    (lambda: mass_matrix(1.0, (0, 0, 0)), "gyradii"),
    (lambda: mass_matrix(1.0, (0, 0, 0), gyradii=(1, 1, 1), inertia=np.eye(3)), "one of the two"),
    (lambda: mass_matrix(1.0, (0, 0, 0), inertia=-np.eye(3)), "not negative"),
    (lambda: mass_matrix(1.0, (0, 0, 0), dofs=("Bending",)), "rigid modes"),
    (lambda: mass_matrix(1.0, (0, 0, 0), dofs=("a__Heave", "b__Heave")), "one body"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call()


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 4))
def test_a_passive_memory_makes_a_stable_passive_composite(seed, n):
    model = coupled_model(("Surge", "Heave", "Pitch", "Yaw")[:n], seed)
    assert model.fit.passive
    F, G, H, _ = system_matrices(model)
    assert np.linalg.eigvals(F).real.max() < 1e-9
    omega = np.geomspace(1e-2, 1e2, 200)
    mobility = H[n:2 * n] @ np.linalg.solve(1j * omega[:, None, None] * np.eye(len(F)) - F, G[None].astype(complex))
    lowest = np.linalg.eigvalsh(0.5 * (mobility + np.conj(np.swapaxes(mobility, 1, 2))))[:, 0]
    assert lowest.min() > -1e-9 * np.abs(mobility).max()


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), method=st.sampled_from(["foh", "tustin"]), dt=st.floats(0.01, 1.0))
def test_triangle_hold_and_bilinear_rule_keep_a_memory_passive(seed, method, dt):
    assert rss.sampled(coupled_model(("Sway", "Roll"), seed).fit, dt, method).passive


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_superposition_and_time_shift(seed):
    model, rng = coupled_model(("Sway", "Roll"), seed), np.random.default_rng(seed)
    t = 0.1 * np.arange(300)
    a, b = rng.standard_normal((2, 2, 300))
    whole = linear_response(model, t, 2.0 * a - b).outputs
    parts = 2.0 * linear_response(model, t, a).outputs - linear_response(model, t, b).outputs
    assert whole == pytest.approx(parts, abs=1e-9 * float(np.abs(whole).max()))
    a[:, 0] = 0.0
    later = np.concatenate([np.zeros((2, 50)), a[:, :-50]], axis=1)
    assert linear_response(model, t, later).outputs[:, 50:] == pytest.approx(
        linear_response(model, t, a).outputs[:, :-50], abs=1e-9 * float(np.abs(whole).max()))
