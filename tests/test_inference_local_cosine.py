"""Local cosine bases against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radiation_ss.inference import blocks, projected_on, smooth


def far_from_orthonormal(basis, count):
    """Return the largest difference of the test functions' scalar products from those of an orthonormal basis."""
    table = np.zeros((sum(b.g.shape[0] for b in basis), count))
    at = 0
    for block in basis:
        table[at:at + block.g.shape[0], block.samples] = block.g
        at += block.g.shape[0]
    return np.abs(table @ table.T - np.eye(at)).max()


@given(st.integers(120, 900), st.floats(0.01, 0.2), st.floats(24.0, 60.0), st.floats(0.1, 0.5))
@settings(max_examples=20)
def test_test_functions_are_orthonormal(count, dt, samples, share):
    basis = blocks(count, dt, samples * dt, share * np.pi / dt, 0.25 * samples * dt)
    # Sums stand for integrals: exact but for what the windows hold beyond the Nyquist frequency.
    assert far_from_orthonormal(basis, count) < 1e-3


@pytest.mark.parametrize(("omega", "phase"), [(1.0, 0.0), (3.0, 0.4), (4.5, 2.0)])
def test_derivatives_are_taken_by_the_test_functions(omega, phase):
    dt = 0.05
    time = dt * np.arange(1200)
    x = np.cos(omega * time + phase)
    basis = blocks(time.size, dt, 4.0, 11.0, 1.0)
    size = max(np.abs(b.project(x)).max() for b in basis)
    for order, exact in ((1, -omega * np.sin(omega * time + phase)), (2, -(omega**2) * x)):
        worst = max(np.abs(b.project(x, order) - b.project(exact)).max() for b in basis)
        # The bell's fourth derivative jumps where it meets zero and one: what sums leave of integrals is of order dt^4.
        assert worst < 10.0 * dt**4 * size * omega**order


def test_what_is_in_the_span_comes_back_with_its_derivatives():
    dt = 0.05
    time = dt * np.arange(1200)
    x, inner = np.cos(3.0 * time + 0.3), slice(40, -40)
    found = smooth(blocks(time.size, dt, 4.0, 40.0, 0.5), np.stack([x, x]), np.array([40.0, 0.5]))
    for (part, low), exact in zip(found, (x, -3.0 * np.sin(3.0 * time + 0.3), -9.0 * x)):
        assert np.abs(part - exact)[inner].max() < 2e-2 * np.abs(exact).max()
        # What is above a signal's own top is none of it.
        assert np.abs(low)[400:-400].max() < 3e-2 * np.abs(exact).max()


def test_intervals_of_a_long_record_share_their_test_functions():
    basis = blocks(5000, 0.05, 4.01, 11.0, 0.5, alike=20)
    assert len(basis) > 50 and all(b.g is basis[1].g for b in basis[1:-1])
    assert far_from_orthonormal(basis, 5000) < 1e-3


@pytest.mark.parametrize("alike", [4, np.inf])
@pytest.mark.parametrize("order", range(3))
def test_all_blocks_at_once_are_one_after_the_other(alike, order):
    values = np.random.default_rng(order).standard_normal((2, 1234))
    basis = blocks(1234, 0.05, 5.0, 12.0, 1.0, alike)
    one_by_one = np.stack([block.project(values, order)[:, :7] for block in basis], axis=1)
    assert np.allclose(projected_on(basis, values, order, 7), one_by_one, rtol=1e-12, atol=1e-12)
