"""Rigs that drive one motion and hold another, made here from phasors: what sensors of the held one may say."""

import numpy as np
import pytest
from seeds import some

import radiation_ss as rss

TIME = np.arange(0.0, 40.0, 0.04)
INERTIA, ADDED = np.diag([40.0, 4.0]), np.array([[30.0, 2.0], [2.0, 3.0]])
STIFFNESS, KERNEL = np.diag([2300.0, 250.0]), np.diag([120.0, 8.0])  # of K(s) = KERNEL s / (s^2 + 3 s + 20)


def model():
    a, b = np.kron(np.eye(2), [[0.0, 1.0], [-20.0, -3.0]]), np.kron(np.eye(2), [[0.0], [1.0]])
    fit = rss.RadiationFit(("Heave", "Pitch"), a, b, np.kron(KERNEL, [[0.0, 1.0]]), 4)
    return rss.Model(fit.dofs, INERTIA, ADDED, STIFFNESS, fit)


def driven(which, size, omega, seed, drag=0.0, left_out=(), talk=0.0):
    """One motion is driven, and moves the other by a share `talk` of its phase; sensors of .2 mm and .5 mrad."""
    rng, middle = np.random.default_rng(seed), omega * np.linspace(0.6, 1.5, 9)
    phasor = np.zeros((2, 9), dtype=complex)
    phasor[which] = size / 3.0 * rng.uniform(0.5, 1.0, 9) * np.exp(2j * np.pi * rng.random(9))
    phasor[1 - which] = talk * phasor[which]
    s = 1j * middle
    K = KERNEL[:, :, None] * s / (s**2 + 3.0 * s + 20.0)
    Z = s**2 * (INERTIA + ADDED)[:, :, None] + s * K + STIFFNESS[:, :, None]
    turning = np.exp(np.outer(s, TIME))
    x, v, force = (np.real(p @ turning) for p in (phasor, s * phasor, np.einsum("ijw,jw->iw", Z, phasor)))
    force[0] += drag * np.abs(v[0]) * v[0]
    x += np.array([[2e-4], [5e-4]]) * rng.standard_normal(x.shape)
    force += np.array([[0.4], [0.05]]) * rng.standard_normal(x.shape)
    read = dict(zip(("Heave", "Pitch", "Heave_force", "Pitch_force"), (*x, *force)))
    return rss.Record(TIME, {k: y for k, y in read.items() if k not in left_out}, kind="prescribed",
                      name=f"{which} {omega}")


def programme(seed, **more):
    forces = ("Pitch_force", "Heave_force")
    return [driven(which, size, omega, seed + k, **{key: (forces[which],) if key == "left_out" else value
                                                    for key, value in more.items()})
            for k, (which, size, omega) in enumerate([(0, 0.04, 3.0), (0, 0.03, 5.0), (1, 0.08, 3.0), (1, 0.06, 5.0)])]


@pytest.mark.parametrize("seed", some([10, 20]))
@pytest.mark.parametrize("more", [{}, {"left_out": True}], ids=["both gauges", "the driven motion's gauge"])
@pytest.mark.parametrize("drag, told", [(0.0, []), (900.0, [("quadratic_drag", "Heave")])])
def test_what_the_sensor_of_a_held_motion_shows_is_no_motion(seed, more, drag, told):
    found = rss.diagnose(model(), programme(seed, drag=drag, **more))
    assert [(e.name, e.dof) for e in found.verdict.effects] == told
    assert found.verdict.status == ("effect" if told else "no_gap")
    assert found.how_far.gap_after < 1.3 * found.how_far.noise_floor
    assert sum("is taken as held fast" in note for note in found.notes) == 4


def test_a_prescribed_motion_without_any_force_is_refused():
    records = [driven(0, 0.04, 3.0, 0, left_out=("Heave_force", "Pitch_force"))]
    with pytest.raises(rss.InputError, match="no force is measured"):
        rss.diagnose(model(), records)


def test_a_motion_that_nobody_measured_is_said_to_be_taken_as_rest():
    """Two floats joined by a damper, by its exact response to a sine; only one of them has a sensor."""
    rigid = rss.RadiationFit(("a__Heave", "b__Heave"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    floats = rss.Model(rigid.dofs, np.diag([3.0, 4.0]), np.eye(2), np.diag([60.0, 90.0]), rigid, D=np.diag([3.0, 3.0]))
    w, force = np.array([3.0, 4.0, 5.0]), np.array([[2.0], [0.0]])
    damper = 2.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    x = sum(np.real(np.linalg.solve(-u**2 * np.diag([4.0, 5.0]) + 1j * u * (np.diag([3.0, 3.0]) + damper)
                                    + np.diag([60.0, 90.0]), force) * np.exp(1j * u * TIME)) for u in w)
    channels = {"a__Heave": x[0] + 1e-4 * np.random.default_rng(0).standard_normal(TIME.size),
                "a__Heave_force": 2.0 * np.cos(np.outer(w, TIME)).sum(axis=0), "b__Heave_force": 0.0 * TIME}
    found = rss.diagnose(floats, rss.Record(TIME, channels, kind="forced", name="one sensor"), ["linear_damping"])
    assert sum("one sensor: b__Heave is not measured and taken as at rest" in note for note in found.notes) == 1


@pytest.mark.parametrize("share, noise", [(1e-8, 0.0), (0.0, 0.05)], ids=["rounding", "a gauge's noise"])
def test_a_gauge_of_a_held_motion_that_nothing_couples_shows_no_gap(share, noise):
    """Of a symmetric body a program leaves 1e-8 of the driven motion's force on the others, and they stand still."""
    records = [record.with_channels(Pitch=0.0 * TIME, Pitch_force=share * record.channels["Heave_force"]
                                    + noise * np.random.default_rng(0).standard_normal(TIME.size))
               for record in programme(10)[:2]]
    found = rss.diagnose(model().replace(A_inf=np.diag(np.diag(ADDED))), records)
    assert found.verdict.status == "no_gap" and found.how_far.gap_after < 1.3 * found.how_far.noise_floor


@pytest.mark.parametrize("seed", some([0, 1]))
def test_noise_of_a_slow_motions_sensor_makes_no_force_by_radiation(seed):
    """A soft mooring's period is far longer than those at which the body radiates, and the sensor's noise has them."""
    rng, time, omega = np.random.default_rng(seed), np.arange(0.0, 600.0, 0.5), np.linspace(0.2, 0.5, 9)
    phasor, s = np.exp(2j * np.pi * rng.random(9)), 1j * omega
    soft = model().replace(C=np.diag([50.0, 5.0]))
    needed = s**2 * 70.0 + s * KERNEL[0, 0] * s / (s**2 + 3.0 * s + 20.0) + 50.0
    x, force = (np.real(p @ np.exp(np.outer(s, time))) for p in (phasor, needed * phasor))
    read = {"Heave": x + 0.1 * rng.standard_normal(time.size),
            "Heave_force": force + 0.01 * np.std(force) * rng.standard_normal(time.size)}
    found = rss.diagnose(soft, rss.Record(time, read, kind="prescribed"), ["quadratic_drag", "linear_stiffness"])
    assert found.verdict.status == "no_gap"
    assert found.how_far.gap_before < 1.3 * found.how_far.noise_floor


@pytest.mark.parametrize("seed", some([0, 1]))
def test_what_a_fit_leaves_out_of_its_data_is_no_gap_of_a_prescribed_motion(seed):
    """The force is that of A and B themselves at their own frequencies; two states leave a part of it out."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 120.0, 0.1)
    data = rss.section_2d(rss.lewis_section(1.0, 0.6, 0.95), np.linspace(0.3, 6.0, 58), gyradius=0.7).select("Heave")
    poor = rss.Model.from_hydro(data, rss.fit_radiation(data, 2))
    used = np.flatnonzero((data.omega > 0.8) & (data.omega < 3.0))
    omega, s = data.omega[used], 1j * data.omega[used]
    phasor = rng.uniform(0.5, 1.0, omega.size) * np.exp(2j * np.pi * rng.random(omega.size)) / omega
    Z = s**2 * (data.M[0, 0] + data.A[used, 0, 0]) + s * data.B[used, 0, 0] + data.C[0, 0]
    x, force = (np.real(p @ np.exp(np.outer(s, time))) for p in (phasor, Z * phasor))
    read = {name: y + 0.002 * np.std(y) * rng.standard_normal(time.size)
            for name, y in (("Heave", x), ("Heave_force", force))}
    found = rss.diagnose(poor, rss.Record(time, read, kind="prescribed"), ["linear_damping", "added_inertia"])
    assert found.verdict.status == "no_gap" and found.how_far.gap_before < 0.015 < poor.fit.relative_error


@pytest.mark.parametrize("seed", some([0, 1, 2]))
def test_a_single_frequency_is_no_reason_for_a_gain(seed):
    """Beside it there is the sensor's noise alone, which a body without inertia would explain."""
    rng, omega, time = np.random.default_rng(seed), 4.5, np.arange(0.0, 40.0, 0.02)
    s = 1j * omega
    Z = s**2 * 70.0 + s * KERNEL[0, 0] * s / (s**2 + 3.0 * s + 20.0) + STIFFNESS[0, 0]
    records = []
    for size in (0.02, 0.06, 0.04):
        x, force = (np.real(p * np.exp(s * time)) for p in (size, Z * size))
        read = {"Heave": x + 0.005 * np.std(x) * rng.standard_normal(time.size),
                "Heave_force": force + 0.01 * np.std(force) * rng.standard_normal(time.size)}
        records.append(rss.Record(time, read, kind="prescribed", name=f"{size}"))
    found = rss.diagnose(model(), records[:2], withhold=records[2])
    assert found.verdict.status == "no_gap"
