"""The nu-gap and the margin against published examples, a frequency grid and Vinnicombe's theorem."""

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_bodies import tank_model

import radiation_ss as rss
from radiation_ss.design import hinf_norm


def chordal(P1, P2, omega):
    """Pointwise gap of two scalar plants: the distance on the Riemann sphere."""
    a, b = P1(1j * omega), P2(1j * omega)
    return np.abs(a - b) / np.sqrt((1.0 + np.abs(a) ** 2) * (1.0 + np.abs(b) ** 2))


def test_published_examples():
    # Zhou & Doyle (1998), section 17.2: P1 = 100/(2s+1); the other two look alike in open loop and are far apart.
    P1, P2, P3 = ct.tf([100.0], [2.0, 1.0]), ct.tf([100.0], [2.0, -1.0]), ct.tf([100.0], [1.0, 2.0, 1.0])
    assert rss.gap_metric(P1, P2) == pytest.approx(0.0200, abs=5e-5)
    assert rss.gap_metric(P1, P3) == pytest.approx(0.8988, abs=5e-5)
    # 1/(s - e) and 1/(s + e): the integrator limit, gap 2 e to first order.
    assert rss.gap_metric(ct.tf([1], [1, -0.001]), ct.tf([1], [1, 0.001])) == pytest.approx(0.002, rel=1e-3)


def test_winding_number_decides():
    # k/s and -k/s: the same magnitude, opposite feedback; no controller serves both.
    assert rss.gap_metric(ct.tf([1.0], [1.0, 0.0]), ct.tf([-1.0], [1.0, 0.0])) == 1.0
    assert rss.gap_metric(ct.tf([0.5], [1.0, 1.0]), ct.tf([0.5], [1.0, 1.0])) == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("seed", range(12))
def test_norm_is_the_largest_value_on_a_dense_grid(seed):
    system = ct.rss(4, 2, 3, strictly_proper=bool(seed % 2))
    rng = np.random.default_rng(seed)
    n = 4
    half = rng.standard_normal((n, n))
    a = rng.standard_normal((n, n)) - (3.0 + 0.0 * half) * np.eye(n)
    b, c = rng.standard_normal((n, 3)), rng.standard_normal((2, n))
    d = rng.standard_normal((2, 3)) * (seed % 2)
    assert system.nstates == n
    if np.linalg.eigvals(a).real.max() >= -0.05:
        a -= (np.linalg.eigvals(a).real.max() + 0.1) * np.eye(n)
    w = np.linspace(0.0, 30.0, 30001)
    grid = np.linalg.norm(c @ np.linalg.solve(1j * w[:, None, None] * np.eye(n) - a, b[None].astype(complex)) + d, 2,
                          axis=(1, 2)).max()
    norm = hinf_norm(a, b, c, d)
    assert norm >= grid * (1.0 - 1e-9)
    assert norm == pytest.approx(max(grid, np.linalg.norm(d, 2)), rel=1e-5)


positive = st.floats(0.2, 5.0)


@settings(max_examples=40)
@given(k=st.tuples(positive, positive), m=st.tuples(positive, positive), damping=st.tuples(positive, positive),
       gain=positive)
def test_laws_of_the_gap(k, m, damping, gain):
    P1, P2 = (ct.tf([1.0, 0.0], [m[i], 0.3 * damping[i], k[i]]) for i in (0, 1))
    gap = rss.gap_metric(P1, P2)
    assert gap == pytest.approx(rss.gap_metric(P2, P1), abs=1e-6)
    w = np.geomspace(1e-3, 1e3, 20001)
    # Passive plants: 1 + P2* P1 cannot wind, so the gap is the largest chordal distance.
    assert gap == pytest.approx(chordal(P1, P2, w).max(), abs=2e-4)
    C = ct.tf([gain, gain], [1.0, 0.0])
    b1, b2 = rss.robust_margin(P1, C), rss.robust_margin(P2, C)
    assert np.arcsin(b2) >= np.arcsin(b1) - np.arcsin(min(gap, 1.0)) - 1e-6


@pytest.mark.parametrize("seed", range(25))
def test_unstable_plants_against_roots_of_polynomials(seed):
    # P = n/d: n2(-s) n1(s) + d2(-s) d1(s) must have as many roots in the right half plane as P2 has poles in all.
    rng = np.random.default_rng(seed)
    plants, parts = [], []
    for _ in range(2):
        order = int(rng.integers(1, 4))
        den = np.poly(rng.normal(0.0, 1.0, order)) if order % 2 else np.poly([*rng.normal(0.0, 1.0, order - 2), *(
            rng.normal() + np.array([1j, -1j]) * rng.uniform(0.5, 2.0))]).real
        num = rng.standard_normal(order)
        plants.append(ct.tf(num, den))
        parts.append((np.poly1d(num), np.poly1d(den)))
    (n1, d1), (n2, d2) = parts
    mirror = np.poly1d([-1.0, 0.0])
    roots = (n2(mirror) * n1 + d2(mirror) * d1).roots
    w = np.concatenate([[0.0], np.geomspace(1e-4, 1e4, 40001)])
    expected = chordal(*plants, w).max() if np.sum(roots.real > 0.0) == d2.order else 1.0
    assert rss.gap_metric(*plants) == pytest.approx(expected, abs=1e-4)


def test_margin_of_a_loop():
    # P = 1/(s+1), C = 1: the matrix [P; I](1 + CP)^-1 [C I] has norm sqrt(2) sqrt(1 + |P|^2) / |1 + P|, largest at
    # infinity.
    assert rss.robust_margin(ct.tf([1.0], [1.0, 1.0]), 1.0) == pytest.approx(1.0 / np.sqrt(2.0), rel=1e-6)
    assert rss.robust_margin(ct.tf([1.0], [1.0, 1.0]), -3.0) == 0.0  # unstable loop
    gain, phase, _, _ = ct.margin(ct.tf([4.0], [1.0, 2.0, 1.0, 0.0]))
    b = rss.robust_margin(ct.tf([4.0], [1.0, 2.0, 1.0, 0.0]), 0.2)
    gain, phase, _, _ = ct.margin(0.2 * ct.tf([4.0], [1.0, 2.0, 1.0, 0.0]))
    assert gain >= (1.0 + b) / (1.0 - b) and np.radians(phase) >= 2.0 * np.arcsin(b)


@pytest.mark.parametrize("hidden", [0.0, 0.3, -0.2])
@pytest.mark.parametrize("reached, shown", [(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)])
def test_hidden_modes_are_no_part_of_the_gap_and_one_of_the_loop(hidden, reached, shown):
    """Against the pointwise gap of the transfer functions; an unstable mode that nothing moves is not robust."""
    mixing = np.random.default_rng(2).standard_normal((3, 3))

    def with_hidden(k):
        a, b, c = np.diag([0.0, 0.0, hidden]), np.array([[0.0], [1.0], [reached]]), np.array([[1.0, 0.0, shown]])
        a[:2, :2] = [[0.0, 1.0], [-k, -0.4]]
        return ct.ss(mixing @ np.linalg.solve(mixing.T, a.T).T, mixing @ b, np.linalg.solve(mixing.T, c.T).T, 0.0)

    P, Q, omega = with_hidden(1.0), with_hidden(1.3), np.linspace(1e-3, 5.0, 5000)
    assert rss.gap_metric(P, P) == pytest.approx(0.0, abs=1e-6)
    assert rss.gap_metric(P, Q) == pytest.approx(chordal(P, Q, omega).max(), rel=1e-5)
    own = rss.robust_margin(ct.ss([[0.0, 1.0], [-1.0, -0.4]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0), 0.5)
    assert rss.robust_margin(P, 0.5) == pytest.approx(own if hidden < 0.0 else 0.0, rel=1e-6, abs=1e-9)


def test_bilinear_map_keeps_both():
    dt = 0.2
    P1, P2, C = ct.tf([1.0], [1.0, 0.4, 1.0]), ct.tf([1.3], [1.0, 0.2, 1.4]), ct.tf([0.5, 0.2], [0.1, 1.0])
    sampled = [ct.sample_system(s, dt, "bilinear") for s in (P1, P2, C)]
    assert rss.gap_metric(sampled[0], sampled[1]) == pytest.approx(rss.gap_metric(P1, P2), rel=1e-6)
    assert rss.robust_margin(sampled[0], sampled[2]) == pytest.approx(rss.robust_margin(P1, C), rel=1e-6)


def test_units_matter_and_scaling_is_offered():
    model = tank_model()
    heave, heavier = (rss.cummins(m)[0, 0] for m in (model, model.replace(C=1.2 * model.C)))
    assert rss.gap_metric(heave, heavier) < 0.01  # a millimetre per newton hides everything
    by_stiffness = rss.gap_metric(heave, heavier, input_scale=0.01 * model.C[0, 0], output_scale=0.01)
    assert by_stiffness == pytest.approx(rss.gap_metric(heave * model.C[0, 0], heavier * model.C[0, 0]), rel=1e-6)
    assert by_stiffness > 0.1


@pytest.mark.parametrize("call, words", [
    (lambda: rss.gap_metric(ct.tf([1], [1, 1]), ct.ss([[-1.0]], [[1.0, 0.0]], [[1.0]], [[0.0, 0.0]])), "agree"),
    (lambda: rss.gap_metric(ct.tf([1], [1, 1]), ct.tf([1], [1, 1]), input_scale=-1.0), "input_scale"),
    (lambda: rss.gap_metric(ct.tf([1], [1, 1]), ct.tf([1], [1, 1]), input_scale=[1.0, 2.0]), "one positive number"),
    (lambda: rss.robust_margin(ct.tf([1], [1, 1]), np.ones((2, 2))), "outputs and"),
    (lambda: rss.gap_metric(ct.tf("s"), ct.tf([1], [1, 1])), "^P1: a numerator of higher degree"),
    (lambda: rss.gap_metric(ct.tf([1], [1, 1]), ct.tf([0, 1, 0, 1], [0, 1, 1])), "^P2: a numerator of higher degree"),
    (lambda: rss.gap_metric(3.0, ct.tf([1], [1, 1])), "^P1: float found"),
    (lambda: rss.robust_margin(np.eye(2), 1.0), "^P: ndarray found"),
    (lambda: rss.robust_margin(ct.tf([1], [1, 1]), "a"), "^C: not an array of numbers"),
    (lambda: rss.robust_margin(ct.tf([1], [1, 1]), ct.tf("s")), "^C: a numerator of higher degree"),
])
def test_bad_input_is_said(call, words):
    with pytest.raises(rss.InputError, match=words):
        call()
