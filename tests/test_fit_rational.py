"""Canonical form, its inverse, files of fits, and the certificate on systems whose answer is known."""

import pickle
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import block_diag, expm

from radiation_ss import RadiationFit, read_fit
from radiation_ss.errors import InputError
from radiation_ss.fit import (
    certify,
    frequency_response,
    impulse_response,
    minimal,
    modes,
    observer_form,
    to_polynomials,
)

# Hanaki et al. (2022), Table 3, heave: a1 a2 a3, b1 b2 b3, and whether Re K(iw) stays positive:
# its leading coefficient at high frequency is a3 b3 - b2.
TABLE_3 = {"2D-BEM": ((1130.3213, 230.9063, 22.0178), (105.7441, 12.9617, 0.5849), False),
           "Case-1": ((1118.7779, 229.6268, 22.1839), (107.0172, 12.9494, 0.5830), False),
           "Case-2": ((1093.3195, 236.4745, 22.6247), (107.4617, 12.6381, 0.5801), True),
           "Case-3": ((1092.9484, 239.7216, 22.5530), (106.6844, 12.5331, 0.5830), True)}


def rational(den, num, omega):
    s = 1j * np.atleast_1d(omega)
    return np.polyval(np.r_[num[::-1]], s) / np.polyval(np.r_[1.0, den[::-1]], s)


@pytest.mark.parametrize("row", TABLE_3)
def test_observer_form_is_the_rational_function(row):
    den, num, _ = TABLE_3[row]
    omega = np.linspace(0.0, 60.0, 31)
    assert_allclose(frequency_response(*observer_form(den, num), omega)[:, 0, 0], rational(den, num, omega), rtol=1e-12)


@settings(max_examples=40)
@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_polynomials_survive_a_change_of_state(n, seed):
    rng = np.random.default_rng(seed)
    poles = -rng.uniform(0.3, 3.0, n)
    den = np.poly(poles)[:0:-1]
    num = rng.normal(size=n)
    a, b, c = observer_form(den, num)
    change = np.linalg.qr(rng.normal(size=(n, n)))[0] * rng.uniform(0.5, 2.0, n)
    found = to_polynomials(np.linalg.solve(change, a @ change), np.linalg.solve(change, b), c @ change)
    assert_allclose(found[0], den, rtol=1e-7, atol=1e-9 * np.abs(den).max())
    assert_allclose(found[1], num, rtol=1e-7, atol=1e-9 * max(np.abs(num).max(), np.abs(den).max()))


def test_minimal_removes_what_is_there_twice():
    a, b, c = observer_form(*TABLE_3["Case-2"][:2])
    double = block_diag(a, a), np.vstack([b, b]), np.hstack([c, c])
    reduced = minimal(*double)
    assert reduced[0].shape == (3, 3)
    assert_allclose(to_polynomials(*reduced)[1], 2.0 * b[:, 0], rtol=1e-7)


@pytest.mark.parametrize("seed", range(8))
def test_minimal_removes_what_is_not_reached_and_what_is_not_seen(seed):
    """Also after a change of state, whose rounding leaves a little of each."""
    both, unreached, unseen = (observer_form(*one) for one in (
        ([9.0, 3.0], [0.0, 1.0]), ([4.0, 2.4], [0.0, 1.0]), ([6.0, 11.0, 6.0], [0.0, 0.0, 1.0])))
    a = block_diag(both[0], unreached[0], unseen[0])
    b = np.vstack([both[1], 0.0 * unreached[1], unseen[1]])
    c = np.hstack([both[2], unreached[2], 0.0 * unseen[2]])
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(7, 7)))[0]
    reduced = minimal(turn.T @ a @ turn, turn.T @ b, c @ turn, tolerance=1e-10)
    assert_allclose(np.linalg.eigvals(reduced[0]), np.roots([1.0, 3.0, 9.0]), rtol=1e-9)
    assert_allclose(to_polynomials(*reduced)[1], [0.0, 1.0], atol=1e-9)


def test_lengths_must_agree():
    with pytest.raises(InputError, match="3 and 2 coefficients"):
        observer_form([1.0, 2.0, 3.0], [1.0, 2.0])


@pytest.mark.parametrize("row", TABLE_3)
def test_certificate_of_the_papers_rows(row):
    den, num, passive = TABLE_3[row]
    certificate = certify(*observer_form(den, num))
    assert certificate.stable
    assert certificate.passive is passive
    if not passive:
        edge = {"2D-BEM": 34.9, "Case-1": 39.3}[row]
        assert certificate.worst_omega > edge
        omega = np.linspace(edge - 0.2, edge + 0.2, 401)
        damping = rational(den, num, omega).real
        assert damping[0] > 0.0 > damping[-1]


def test_certificate_finds_a_narrow_dip_between_grid_points():
    # 1/(s+1) less a resonance of width 1e-6 at 3.3 rad/s: negative only within 1e-5 of it.
    damping, at, depth = 1e-6, 3.3, 0.2
    a = block_diag([[-1.0]], [[0.0, at], [-at, -2 * damping]])
    b = np.array([[1.0], [0.0], [1.0]])
    c = np.array([[1.0, 0.0, -2.0 * damping * depth]])
    assert not certify(a, b, c).passive
    assert certify(a, b, np.abs(c)).passive


def test_unstable_is_never_passive():
    certificate = certify(np.array([[0.1]]), np.ones((1, 1)), np.ones((1, 1)))
    assert not certificate.stable and not certificate.passive


def test_json_and_pickle_round_trip(tmp_path):
    a, b, c = observer_form(*TABLE_3["Case-3"][:2])
    fit = RadiationFit(("Heave",), a, b, c, order=3, points=(7.0,), relative_error=0.02, whole_error=0.2, A_inf=[[2.0]])
    for again in (read_fit(fit.write(tmp_path / "fit.json")), pickle.loads(pickle.dumps(fit))):
        for name in ("a", "b", "c", "A_inf"):
            assert np.array_equal(getattr(again, name), getattr(fit, name))
        assert (again.points, again.order, again.relative_error, again.whole_error) == (fit.points, 3, 0.02, 0.2)
    assert_allclose(fit.polynomials("Heave", "Heave")[0], TABLE_3["Case-3"][0])


def test_unreadable_fits_are_named(tmp_path):
    (tmp_path / "bad.json").write_text("{}")
    with pytest.raises(InputError, match=r"bad.json.*schema"):
        read_fit(tmp_path / "bad.json")
    with pytest.raises(InputError, match="cannot be read"):
        read_fit(tmp_path / "none.json")


@pytest.mark.parametrize("seed", range(4))
def test_response_and_kernel_by_modes_are_those_by_linear_algebra(seed):
    rng = np.random.default_rng(seed)
    a, b, c = rng.standard_normal((6, 6)) - 4.0 * np.eye(6), rng.standard_normal((6, 2)), rng.standard_normal((3, 6))
    omega, t = np.geomspace(1e-2, 1e3, 50), np.linspace(0.0, 3.0, 20)
    direct = np.stack([c @ np.linalg.solve(1j * w * np.eye(6) - a, b) for w in omega])
    assert modes(a, b, c) is not None
    assert frequency_response(a, b, c, omega) == pytest.approx(direct, abs=1e-12 * np.abs(direct).max())
    assert impulse_response(a, b, c, t) == pytest.approx(np.stack([c @ expm(a * s) @ b for s in t]), abs=1e-11)
    stack = frequency_response(np.stack([a, 2.0 * a]), np.stack([b, b]), np.stack([c, c]), omega)
    assert stack[0] == pytest.approx(direct, abs=1e-12 * np.abs(direct).max())
    assert stack[1] == pytest.approx(frequency_response(2.0 * a, b, c, omega), rel=1e-12)


@pytest.mark.parametrize("split", [0.0, 1e-12, 1e-9, 1e-6])
def test_near_a_double_pole_the_digits_stay(split):
    # 1/((s+1)(s+1+split)): closed form. Modes would cancel; the linear solve takes over.
    a, b, c = np.array([[-1.0, 0.0], [1.0, -1.0 - split]]), np.array([[1.0], [0.0]]), np.array([[0.0, 1.0]])
    omega = np.geomspace(1e-2, 10.0, 20)
    s = 1j * omega
    found = frequency_response(a, b, c, omega)[:, 0, 0]
    assert found == pytest.approx(1.0 / ((s + 1.0) * (s + 1.0 + split)), rel=1e-11)


@pytest.mark.parametrize("weakened", [0.0, 0.02])
def test_a_model_given_entry_by_entry_is_certified_as_the_whole_is_and_as_fast(weakened):
    """Six motions with common poles: 48 states; each entry by itself, in coordinates of its own, 1728 of them."""
    rng = np.random.default_rng(3)
    pairs = [np.array([[0.0, w], [-w, -0.4 * w]]) for w in np.geomspace(0.3, 3.0, 4)]
    vectors = [rng.normal(size=(6, 6)) for _ in pairs]
    whole = (block_diag(*[np.kron(np.eye(6), pair) for pair in pairs]),
             np.vstack([np.kron(V.T, [[0.0], [1.0]]) for V in vectors]),
             np.hstack([np.kron(V, [[0.0, 1.0]]) for V in vectors]))
    whole[2][0, :2] -= weakened * whole[2][0, 1]     # the power of one motion depends on the phase
    parts, c, b = [], [], []
    for i in range(6):
        for j in range(6):
            for k, V in enumerate(vectors):
                change = rng.normal(size=(2, 2)) + 3.0 * np.eye(2)
                strength = np.kron(V[j], [[0.0], [1.0]])
                row = whole[2][i, 12 * k:12 * (k + 1)].reshape(6, 2)
                realised = np.linalg.solve(change, pairs[k] @ change), np.linalg.solve(change, strength), row @ change
                for m in range(6):
                    parts.append(realised[0])
                    b.append(np.outer(realised[1][:, m], np.eye(6)[j]))
                    c.append(np.outer(np.eye(6)[i], realised[2][m]))
    a, b, c = block_diag(*parts), np.vstack(b), np.hstack(c)
    omega = np.linspace(0.0, 5.0, 7)
    assert_allclose(frequency_response(a, b, c, omega), frequency_response(*whole, omega), atol=1e-10)
    start = time.process_time()
    found, known = certify(a, b, c), certify(*whole)
    assert time.process_time() - start < 20.0
    assert (found.stable, found.passive) == (known.stable, known.passive) == (True, weakened == 0.0)
    assert_allclose([found.margin, found.abscissa, found.K_zero], [known.margin, known.abscissa, known.K_zero],
                    rtol=1e-8, atol=1e-12)
