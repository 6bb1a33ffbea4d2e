"""Kernel, Kramers-Kronig and change of reference point against rational functions known in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import simpson
from scipy.linalg import expm
from scipy.special import sici

import radiation_ss as rss
from radiation_ss.hydro import (
    added_mass_from_damping,
    estimate_A_inf,
    exponential_integral,
    fit_tail,
    kernel,
    velocity_transform,
)

SIX = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")


class Memory:
    """K(s) = (b2 s + b1) / (s^2 + a2 s + a1) + its kernel; passive, B ~ w^-2 above."""

    def __init__(self, a1=4.0, a2=1.2, b1=0.5, b2=2.0, A_inf=5.0):
        self.a, self.b, self.A_inf = np.array([[0.0, -a1], [1.0, -a2]]), np.array([b1, b2]), A_inf

    def K(self, w):
        s = 1j * w[:, None, None]
        return (self.b[1] * s + self.b[0]) / (s**2 - self.a[1, 1] * s - self.a[0, 1])

    def kernel(self, t):
        return np.array([(expm(self.a * x) @ self.b)[1] for x in t])[:, None, None]

    def data(self, w, A_inf=True):
        K = self.K(w)
        return rss.HydroData(omega=w, A=self.A_inf + K.imag / w[:, None, None], B=K.real, dofs=("Heave",),
                             A_inf=[[self.A_inf]] if A_inf else None)


def test_kernel_of_a_known_memory():
    memory, t = Memory(), np.linspace(0.0, 20.0, 150)
    data = memory.data(np.linspace(0.02, 30.0, 400))
    scale = np.abs(memory.kernel(t)).max()
    assert np.abs(data.kernel(t) - memory.kernel(t)).max() < 5e-4 * scale


def test_there_and_back_on_a_section():
    w = np.linspace(0.3, 30.0, 120)
    data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), w, 0.45, panels=40).select("Heave")
    t = np.linspace(0.0, 12.0, 1200)
    waves = np.exp(-1j * w[:, None] * t)
    K = simpson(waves * data.kernel(t)[:, 0, 0], x=t)       # (3) and (4)
    assert np.abs(K.real - data.B[:, 0, 0]).max() < 2e-3 * data.B.max()
    assert np.abs(K.imag - data.K[:, 0, 0].imag).max() < 5e-3 * np.abs(data.K).max()


def test_a_inf_is_recovered_within_its_uncertainty_and_the_truncated_band_says_so():
    memory = Memory()
    for top in (6.0, 12.0, 40.0):
        bare = memory.data(np.linspace(0.05, top, 300), A_inf=False)
        found = estimate_A_inf(bare.omega, bare.A, bare.B)
        assert abs(found.value[0, 0] - 5.0) < 3.0 * found.std[0, 0]
        share = np.trapezoid(memory.K(np.geomspace(top, 1e5, 20000)).real[:, 0, 0], np.geomspace(top, 1e5, 20000))
        whole = np.pi / 2 * memory.b[1]  # int_0^oo B dw = pi/2 L(0)
        assert found.tail.share[0, 0] == pytest.approx(share / whole, rel=0.3)
    filled = bare.with_A_inf()
    assert filled.A_inf[0, 0] == found.value[0, 0]
    assert "A_inf estimated" in filled.notes[-1]
    assert filled.with_A_inf() is filled


def test_a_band_that_ends_before_the_damping_falls_says_that_A_inf_is_not_known(caplog):
    memory = Memory()
    peak = max(np.linspace(0.05, 6.0, 500), key=lambda w: memory.K(np.array([w])).real[0, 0, 0])
    bare = memory.data(np.linspace(0.05, 0.7 * peak, 30), A_inf=False)
    found = bare.with_A_inf()
    assert any("Heave still rises" in text for text in caplog.messages) and "Heave 1e+02 %" in found.notes[-1]
    caplog.clear()
    memory.data(np.linspace(0.05, 3.0 * peak, 80), A_inf=False).with_A_inf()
    assert not caplog.messages


def test_noise_of_the_last_damping_does_not_make_it_rise(caplog):
    """A semisubmersible's file ends so: a few per cent of the largest damping, the last value above those before."""
    memory, w = Memory(A_inf=0.5), np.linspace(0.05, 8.0, 60)
    for last in (1.0, 2.0, 3.0):
        bare = memory.data(w, A_inf=False)
        B = bare.B.copy()
        B[-1] *= last
        found = estimate_A_inf(w, bare.A, B)
        assert B[-1, 0, 0] < 0.1 * B.max() and not found.rising.any()
        assert abs(found.value[0, 0] - 0.5) < 3.0 * found.std[0, 0] < 0.1
        bare.replace(B=B).with_A_inf()
    assert not caplog.messages


def test_a_band_that_ends_just_past_the_largest_damping_does_not_say_that_it_rises(caplog):
    memory = Memory()
    peak = max(np.linspace(0.05, 6.0, 500), key=lambda w: memory.K(np.array([w])).real[0, 0, 0])
    bare = memory.data(np.linspace(0.05, 1.04 * peak, 40), A_inf=False)
    share = bare.B[-1, 0, 0] / bare.B.max()
    assert 0.98 < share < 1.0 and estimate_A_inf(bare.omega, bare.A, bare.B).rising.all()
    bare.with_A_inf()
    (text,) = caplog.messages
    assert f"Heave is still {100 * share:.0f} % of its largest at {bare.omega[-1]:g} rad/s" in text
    assert "rises" not in text


def test_the_section_solver_obeys_kramers_kronig():
    data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.3, 30.0, 120), 0.45, panels=40)
    residual = data.A - data.A_inf - added_mass_from_damping(data.omega, data.B)
    diagonal = np.abs(np.diagonal(residual, axis1=1, axis2=2)) / np.diagonal(data.A_inf)
    assert diagonal[:, 1].max() < 1e-4
    assert diagonal.max() < 2e-3


def test_noise_in_the_damping_widens_the_uncertainty():
    w, memory = np.linspace(0.05, 20.0, 300), Memory()
    clean = memory.data(w)
    spread = []
    for seed in range(5):
        noisy = clean.B + 0.02 * clean.B.max() * np.random.default_rng(seed).standard_normal(clean.B.shape)
        found = estimate_A_inf(w, clean.A, noisy)
        assert abs(found.value[0, 0] - 5.0) < 4.0 * found.std[0, 0]
        spread.append(found.std[0, 0])
    assert min(spread) > estimate_A_inf(w, clean.A, clean.B).std[0, 0]


@settings(max_examples=60)
@given(x=st.floats(1e-6, 200.0))
def test_tail_integral_has_its_closed_form_for_power_two(x):
    si, ci = sici(x)
    found = exponential_integral(2.0, np.array([x]))[0]
    assert found.real == pytest.approx(np.cos(x) - x * (np.pi / 2 - si), abs=1e-10)
    assert found.imag == pytest.approx(np.sin(x) - x * ci, abs=1e-10)


def test_too_few_frequencies_and_negative_times_are_refused():
    with pytest.raises(rss.InputError, match="at least 4"):
        fit_tail([1.0, 2.0, 3.0], np.ones((3, 1, 1)))
    with pytest.raises(rss.InputError, match="not negative"):
        kernel(np.arange(1.0, 9.0), np.ones((8, 1, 1)), [-1.0])


def six_dof(seed):
    rng = np.random.default_rng(seed)

    def spd():
        root = rng.standard_normal((6, 6))
        return root @ root.T

    return rss.HydroData(omega=[0.5, 1.0], A=[spd(), spd()], B=[spd(), spd()], A_inf=spd(), M=spd(), C=spd(), D=spd(),
                         X=rng.standard_normal((2, 3, 6)) + 1j * rng.standard_normal((2, 3, 6)), dofs=SIX,
                         directions=[0.0, 1.0, 2.0], reference_point=(0.3, -0.2, 0.1))


point = st.tuples(*[st.floats(-20.0, 20.0)] * 3)


@settings(max_examples=30)
@given(seed=st.integers(0, 99), p=point, q=point)
def test_moving_the_reference_point_composes_and_keeps_power(seed, p, q):
    data = six_dof(seed)
    direct, twice = data.at(q), data.at(p).at(q)
    for name in ("A", "B", "A_inf", "M", "C", "D", "X"):
        a, b = getattr(direct, name), getattr(twice, name)
        assert np.abs(a - b).max() <= 1e-10 * max(1.0, np.abs(getattr(data.at(p), name)).max(), np.abs(a).max())
    # the same rigid motion, seen from both points, takes the same power
    T = velocity_transform(SIX, np.asarray(data.reference_point) - np.asarray(q))
    velocity = np.random.default_rng(seed).standard_normal(6)
    assert velocity @ direct.B[0] @ velocity == pytest.approx((T @ velocity) @ data.B[0] @ (T @ velocity), rel=1e-9)
    assert (direct.X[1, 2] @ velocity) == pytest.approx(data.X[1, 2] @ (T @ velocity), rel=1e-9)


def test_a_rigid_rotation_moves_the_old_point_as_omega_cross_r():
    rng = np.random.default_rng(1)
    arm, v, spin = rng.standard_normal((3, 3))
    T = velocity_transform(SIX, arm)
    np.testing.assert_allclose(T @ np.concatenate([v, spin]), np.concatenate([v + np.cross(spin, arm), spin]))


def test_sway_and_roll_about_g_are_the_papers_congruence():
    data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), [3.0, 6.0], 0.45, panels=40)
    depth_of_g = 0.04
    moved = data.at((0.0, 0.0, -depth_of_g)).select(("Sway", "Roll"))
    flip = np.diag([1.0, -1.0])  # y down turns the roll angle
    T = np.array([[1.0, depth_of_g], [0.0, 1.0]])
    paper = flip @ data.select(("Sway", "Roll")).A @ flip
    np.testing.assert_allclose(flip @ moved.A @ flip, T.T @ paper @ T, rtol=1e-12, atol=1e-12)


def test_a_missing_translation_is_named():
    data = six_dof(0)
    assert data.select("Roll").at((9.0, -0.2, 0.1)).A[0, 0, 0] == data.A[0, 3, 3]
    with pytest.raises(rss.InputError, match="'Roll' about the new point brings in 'Sway'"):
        data.select("Roll").at((0.0, -0.2, -1.0))
    with pytest.raises(rss.InputError, match="three finite"):
        data.at((0.0, 1.0))
