"""The check names what is wrong and where; cleaning changes that and nothing else."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import radiation_ss as rss
from radiation_ss import HydroData

OMEGA = np.linspace(0.05, 12.0, 240)
A_INF = np.array([[5.0e4, 1.0e5], [1.0e5, 2.0e6]])
RESIDUES = ((1.0, 0.5, np.array([[4.0e4, 6.0e4], [6.0e4, 4.0e5]])),
            (2.0, 0.8, np.array([[1.0e4, -2.0e4], [-2.0e4, 3.0e5]])))


def passive(omega=OMEGA, **changes):
    """Return coefficients of a known passive K(s) = sum R s / (s^2 + c s + w0^2), R positive definite.

    Causal, so A and B are an exact Kramers-Kronig pair.
    """
    s = 1j * omega
    K = sum(R * (s / (s * s + c * s + w0 * w0))[:, None, None] for w0, c, R in RESIDUES)
    fields = dict(A=A_INF + K.imag / omega[:, None, None], B=K.real, A_inf=A_INF)
    return HydroData(omega, **{**fields, **changes}, dofs=("Heave", "Pitch"))


def kinds(report, problems=True):
    return {f.kind for f in (report.problems if problems else report.findings)}


def the(report, kind):
    return max((f for f in report.findings if f.kind == kind), key=lambda f: f.value)


def test_consistent_data_pass():
    report = passive().check()
    assert report.ok and "no problem found" in report.text()
    assert not report.findings
    # The damping falls as omega^-2, so a little lies beyond the band: the tail's share is what the integral says.
    wide = np.concatenate([OMEGA, np.geomspace(12.0, 1e5, 4000)[1:]])
    shares = 1.0 - np.trapezoid(passive().B, OMEGA, axis=0) / np.trapezoid(passive(wide).B, wide, axis=0)
    np.testing.assert_allclose(report.tail.share, shares, rtol=0.15)
    assert np.abs(report.kramers_kronig[:-24]).max() < 0.01 and report.smallest_eigenvalue.min() > 0.0


def test_negative_damping_is_placed_in_frequency_and_motion():
    B = passive().B.copy()
    B[:, 1, 1] -= 8.0e4 * np.exp(-(((OMEGA - 5.0) / 0.4) ** 2))
    report = passive(B=B).check()
    found = the(report, "negative damping")
    assert found.problem and found.dofs == ("Pitch",)
    (low, high), = found.bands
    assert 4.0 < low < 5.0 < high < 6.0
    # Independent of the report: generalised eigenvalues over the largest damping of each motion.
    scale = np.sqrt([B[:, 0, 0].max(), B[:, 1, 1].max()])
    values = np.linalg.eigvalsh(B / np.outer(scale, scale))
    assert report.smallest_eigenvalue.min() == pytest.approx(values.min(), rel=1e-12)
    assert report.data.omega[report.smallest_eigenvalue.argmin()] == pytest.approx(5.0, abs=0.11)


def test_negative_damping_hidden_in_the_coupling_is_found():
    B = passive().B.copy()
    B[100:120, 0, 1] += 3.0e4
    B[100:120, 1, 0] += 3.0e4
    assert (np.einsum("kii->ki", B) > 0.0).all()
    found = the(passive(B=B).check(), "negative damping")
    assert found.problem and set(found.dofs) == {"Heave", "Pitch"} and "couplings" in found.message
    assert found.bands[0] == (OMEGA[100], OMEGA[119])


def test_asymmetry_names_the_entry():
    A = passive().A.copy()
    A[50:60, 0, 1] *= 1.5
    found = the(passive(A=A).check(), "asymmetry")
    assert set(found.dofs) == {"Heave", "Pitch"} and found.bands == ((OMEGA[50], OMEGA[59]),) and found.problem
    data = passive()
    A_inf = data.A_inf + np.array([[0.0, 0.2], [0.0, 0.0]]) * np.sqrt(np.ptp(data.A[:, [0, 1], [0, 1]], axis=0).prod())
    found = the(passive(A_inf=A_inf).check(), "asymmetry")
    assert found.message.startswith("A_inf of Heave-Pitch") and found.problem


@pytest.mark.parametrize("width", [1, 2])
@pytest.mark.parametrize("field", ["A", "B"])
def test_a_spike_is_found_at_its_frequency(field, width):
    values = getattr(passive(), field).copy()
    size = np.ptp(values[:, 0, 0])
    values[80:80 + width, 0, 0] += 0.2 * size
    report = passive(**{field: values}).check()
    found = the(report, "irregular frequency")
    assert found.problem and found.dofs == ("Heave",)
    assert found.bands[0][0] <= OMEGA[80] <= found.bands[0][1] and found.bands[0][1] - found.bands[0][0] < 0.5
    assert 0.05 < found.value < 0.4


@pytest.mark.parametrize("count", [400, 800, 1600])
def test_a_narrow_resonance_is_found_whether_resolved_or_not(count):
    """Added to A and B alike it is causal: Kramers-Kronig cannot see it once the steps resolve it."""
    fine = np.linspace(0.05, 8.0, count)
    s = 1j * fine
    narrow = 3.0e3 * s / (s * s + 0.05 * s + 9.0)
    base = passive(fine)
    A, B = base.A.copy(), base.B.copy()
    A[:, 0, 0] += narrow.imag / fine
    B[:, 0, 0] += narrow.real
    report = passive(fine, A=A, B=B).check()
    found = the(report, "spike")
    assert found.problem and found.dofs == ("Heave",) and found.bands[0][0] < 3.0 < found.bands[0][1]
    assert count < 800 or "Kramers-Kronig" not in kinds(report)


def test_added_mass_and_damping_of_different_bodies_are_no_pair():
    found = the(passive(B=1.3 * passive().B).check(), "Kramers-Kronig")
    assert found.problem and found.value > 0.1


@pytest.mark.parametrize("factor, hertz", [(1.0 / (2.0 * np.pi), True), (1.5 / (2.0 * np.pi), False), (6.0, False)])
def test_frequencies_in_hertz_are_told(factor, hertz):
    """A - A_inf goes as B / omega: the pair holds at one scale of the frequencies only."""
    exact = passive()
    found = the(HydroData(factor * OMEGA, exact.A, exact.B, A_INF, dofs=exact.dofs).check(), "Kramers-Kronig")
    assert found.problem and ("in Hz" in found.message) == hertz


def test_wrong_and_missing_A_inf():
    scale = np.abs(passive().A - A_INF).max(axis=0)
    wrong = A_INF + np.diag([0.3 * scale[0, 0], 0.0])
    found = the(passive(A_inf=wrong).check(), "A_inf offset")
    assert found.problem and found.dofs == ("Heave",) and found.value == pytest.approx(0.3, rel=0.3)
    report = passive(A_inf=None).check()
    assert report.ok and "with_A_inf" in the(report, "A_inf missing").message


@pytest.mark.parametrize("M, dofs, words", [
    ([[-50.0, 0.0], [0.0, 9e5]], ("Heave",), r"inertia_matrix \(M\) of Heave is -50 kg; it must be positive"),
    ([[4e4, 0.0], [0.0, 0.0]], ("Pitch",), r"of Pitch is 0 kg m\^2; it must be positive"),
    ([[4e4, 2e6], [2e6, 9e5]], ("Heave", "Pitch"), r"\(M\) \+ A_inf is not positive definite"),
])
def test_an_inertia_that_no_body_has_is_a_problem_and_says_nothing_of_the_stiffness(M, dofs, words):
    data = passive(M=M, C=np.diag([3e5, 2e6]))
    report = data.check()
    found = the(report, "inertia")
    assert not report.ok and found.dofs == dofs and re.search(words, found.message)
    assert "negative stiffness" not in kinds(report, problems=False)
    with pytest.raises(rss.InputError, match=words):
        rss.Model.from_hydro(data.replace(source="body.nc"))
    falls = data.replace(C=np.diag([3e5, -2e6])).check()       # of a motion without inertia nothing is said
    assert [f.dofs for f in falls.findings if f.kind == "negative stiffness"] == [("Pitch",)] * (M[1][1] > 0.0)


def test_bands_too_short_too_late_too_coarse():
    assert the(passive(OMEGA[OMEGA < 1.5]).check(), "short band").problem
    late = the(passive(OMEGA[OMEGA > 0.9]).check(), "late band")
    assert late.problem and late.bands[0][0] == 0.0
    assert the(passive(np.linspace(0.1, 12.0, 14)).check(), "coarse band").problem
    few = passive(np.array([1.0, 2.0, 3.0])).check()
    assert "only 3 frequencies" in the(few, "coarse band").message and not few.ok
    with pytest.raises(rss.InputError, match="tolerance"):
        passive().check(tolerance=3.0)


def test_a_section_passes_though_its_damping_does_not_vanish_at_zero_frequency():
    for depth in (np.inf, 0.45):
        data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 30.0, 60), depth)
        report = data.check()
        assert report.ok and not {"spike", "asymmetry", "negative damping"} & kinds(report, problems=False)


def test_the_report_goes_into_strict_json():
    import json

    report = passive(OMEGA[(OMEGA > 0.5) & (OMEGA < 2.0)], A_inf=None).check()
    content = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert {f["kind"] for f in content["findings"]} >= {"short band", "A_inf missing"}
    assert len(content["omega"]) == len(content["smallest_eigenvalue"])


def test_a_mode_that_does_not_radiate_is_left_out_and_said():
    rng = np.random.default_rng(0)
    base = passive()
    A, B = np.zeros((OMEGA.size, 3, 3)), 1e-8 * rng.normal(size=(OMEGA.size, 3, 3))
    A[:, :2, :2], B[:, :2, :2] = base.A, base.B
    data = HydroData(OMEGA, A, B, dofs=("Heave", "Pitch", "Yaw"))
    report = data.check()
    assert report.ok and the(report, "non-radiating mode").dofs == ("Yaw",)


@settings(max_examples=15)
@given(units=st.lists(st.floats(1e-3, 1e3), min_size=2, max_size=2), rho=st.floats(0.5, 2.0))
def test_measures_do_not_depend_on_units(units, rho):
    base = passive(B=1.2 * passive().B)
    weight = rho * np.outer(units, units)
    other = passive(A=weight * base.A, B=weight * base.B, A_inf=weight * base.A_inf)
    one, two = base.check(), other.check()
    for name in ("smallest_eigenvalue", "asymmetry", "kramers_kronig", "spikes"):
        np.testing.assert_allclose(getattr(two, name), getattr(one, name), rtol=1e-6, atol=1e-9, err_msg=name)
    assert [f.kind for f in one.findings] == [f.kind for f in two.findings]


@settings(max_examples=40)
@given(nw=st.integers(1, 14), n=st.integers(1, 3), seed=st.integers(0, 99), limit=st.booleans(),
       kind=st.sampled_from(["random", "zero", "mixed"]))
def test_any_finite_data_can_be_checked_and_cleaned(nw, n, seed, kind, limit):
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(2, nw, n, n)) * 10.0 ** rng.uniform(-6, 6, size=(2, 1, n, n))
    if kind != "random":
        B = B * (0.0 if kind == "zero" else rng.integers(0, 2, size=(1, n, 1)))
    data = HydroData(np.sort(rng.uniform(0.1, 5.0, nw)), A, B, np.eye(n) if limit else None,
                     dofs=("Heave", "Pitch", "Yaw")[:n])
    report = data.check()
    assert np.isfinite(report.smallest_eigenvalue).all() and np.isfinite(report.spikes).all()
    assert str(report).count("\n") >= 1
    cleaned = data.clean(symmetric=True, negative_damping=True)
    assert np.isfinite(cleaned.check().smallest_eigenvalue).all()
    np.testing.assert_allclose(cleaned.B, cleaned.B.transpose(0, 2, 1), atol=1e-9 * np.abs(B).max())


def test_coupling_to_a_motion_without_damping_is_negative_damping():
    B = passive().B.copy()
    B[:, 1, 1] = 0.0
    report = passive(B=B).check()
    assert report.smallest_eigenvalue.min() < -0.3 and "non-radiating mode" not in kinds(report, problems=False)


def npz(folder, name):
    """Return third-party coefficients; the first frequency of some is zero."""
    content = np.load(folder / "bem" / f"{name}.npz")
    inside, n = content["w"] > 0.0, content["A"].shape[1]
    names = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
    dofs = names if n == 6 else [f"{b}__{m}" for b in ("float", "spar") for m in names]
    return HydroData(content["w"][inside], content["A"][inside], content["B"][inside], content["Ainf"], dofs,
                     source=name)


def test_tanker_has_negative_damping(data):
    report = npz(data, "mss_tanker").check()
    found = the(report, "negative damping")
    assert found.problem and found.dofs == ("Heave", "Pitch")
    assert report.smallest_eigenvalue.min() == pytest.approx(-0.971, abs=0.005)
    assert report.data.omega[report.smallest_eigenvalue.argmin()] == pytest.approx(3.927, abs=1e-3)
    assert found.bands[0][0] == pytest.approx(3.653, abs=1e-3)
    assert {"asymmetry", "Kramers-Kronig", "irregular frequency"} <= kinds(report)


def test_rm3_names_negative_damping_in_the_coupling_of_its_bodies(data):
    report = npz(data, "bem_wecsim_rm3").check()
    found = the(report, "negative damping")
    assert {d.split("__")[0] for d in found.dofs} == {"float", "spar"} and "couplings" in found.message
    assert found.problem and found.value == pytest.approx(0.039, abs=0.005)
    assert found.bands[0][0] < 1.28 < found.bands[0][1]
    assert {"asymmetry", "A_inf offset", "Kramers-Kronig"} <= kinds(report)


def test_sphere_passes_and_irregular_frequencies_of_another_run_do_not(data):
    folder = data / "bem" / "formats"
    for wamit in (npz(data, "bem_wecsim_sphere"), rss.read_hydro(folder / "sphere.1")):
        (above,) = (f for f in wamit.check().findings if f.problem)  # where the band ends |K| of heave is half its peak
        assert above.kind == "irregular frequency" and "Heave 8.58 rad/s" in above.message
    assert rss.read_hydro(folder / "sphere_capytaine.nc").check().ok
    report = rss.read_hydro(folder / "nemoh3_sphere").check()
    places = the(report, "irregular frequency").bands
    for irregular in (2.24, 2.78, 3.72, 5.12):
        assert any(low - 0.01 <= irregular <= high + 0.01 for low, high in places)


def interior_frequencies(order, radius, g=9.81):
    """Return irregular frequencies of a half-submerged sphere, lowest first: standing waves in it, zero on its hull.

    Of cos(order phi), in solid harmonics r^n P_n^m(cos theta) of radius 1: surface shapes r^m (1 - r^2) r^(2 k) are
    continued into the water, and phi_z = K phi on the surface is an eigenvalue problem for them (Galerkin).
    """
    from scipy.linalg import eigh
    from scipy.special import lpmv

    n, tiny = np.arange(order, order + 40), 1e-5
    theta = np.linspace(0.5, 1.0, 200)[:, None] * np.pi
    x, weight = np.polynomial.legendre.leggauss(60)
    r = 0.5 * (x[:, None] + 1.0)
    value = r ** n * lpmv(order, n, 0.0)
    slope = r ** (n - 1.0) * (lpmv(order, n, tiny) - lpmv(order, n, -tiny)) / (2.0 * tiny)
    hull = lpmv(order, n, np.cos(theta))
    size = np.abs(hull).max(axis=0)
    shapes = r ** order * (1.0 - r ** 2) * r ** (2.0 * np.arange(6))
    wanted = np.vstack([shapes, np.zeros((theta.size, 6))])
    c = np.linalg.lstsq(np.vstack([value, hull]) / size, wanted, rcond=1e-12)[0]
    area = (weight * r[:, 0])[:, None]
    stiffness, mass = shapes.T @ (area * (slope / size @ c)), shapes.T @ (area * shapes)
    return np.sqrt(g / radius * eigh(0.5 * (stiffness + stiffness.T), mass, eigvals_only=True))


@pytest.mark.parametrize("name", ["cylinder_capytaine.nc", "sphere_capytaine.nc", "raft_cylinder.1"])
@pytest.mark.parametrize("count", [8, 20])
def test_a_clean_file_at_few_of_its_frequencies_has_no_irregular_ones(data, name, count):
    whole = rss.read_hydro(data / "bem" / "formats" / name)
    at = np.unique(np.linspace(0.02 * whole.omega.size, whole.omega.size - 1, count).astype(int))
    few = replace(whole, omega=whole.omega[at], A=whole.A[at], B=whole.B[at],
                  X=None if whole.X is None else whole.X[at])
    assert not [f for f in few.check().findings if f.kind in ("irregular frequency", "spike")]


def test_irregular_frequencies_are_those_of_the_water_inside(data):
    """The first two of heave (m = 0) and of surge (m = 1), from the eigenvalue problem of the closed interior."""
    report = rss.read_hydro(data / "bem" / "formats" / "nemoh3_sphere").check()
    found = the(report, "irregular frequency")
    for order in (0, 1):
        for frequency in interior_frequencies(order, radius=5.0)[:2]:
            assert any(low - 0.02 <= frequency <= high + 0.02 for low, high in found.bands), frequency


def test_the_pictures_show_every_degree_of_freedom():
    import matplotlib.pyplot as plt

    data = passive(X=np.ones((OMEGA.size, 1, 2)))
    flat = data.replace(B=np.ones_like(data.B) * np.eye(2))
    for figure in (data.plot(), data.plot("Pitch"), data.check().plot(), flat.check().plot()):
        assert len(figure.axes) in (3, 4, 6)
        figure.canvas.draw()
        plt.close(figure)
    text = [label.get_text() for label in passive().check().plot().axes[0].get_legend().get_texts()]
    plt.close("all")
    assert text == ["Heave", "Pitch"]


# Cleaning


def changed(before, after):
    names = ("omega", "A", "B", "A_inf", "A_zero", "M", "C", "D", "X")
    return {n for n in names if not np.array_equal(getattr(before, n), getattr(after, n))
            and not (getattr(before, n) is None and getattr(after, n) is None)}


def full(**changes):
    return passive(M=np.eye(2), C=np.eye(2), X=np.ones((OMEGA.size, 1, 2)), A_zero=A_INF, **changes)


def test_nothing_asked_nothing_changed():
    data = full()
    assert data.clean() is data


def test_lifting_negative_damping_touches_only_those_frequencies():
    B = passive().B.copy()
    B[100:103, 0, 0] = -5.0e3
    data = full(B=B)
    cleaned = data.clean(negative_damping=True)
    assert changed(data, cleaned) == {"B"}
    touched = np.flatnonzero((cleaned.B != data.B).any(axis=(1, 2)))
    assert touched.tolist() == [100, 101, 102]
    assert np.linalg.eigvalsh(cleaned.B).min() > -1e-9 * cleaned.B.max()
    assert "3 of 240 frequencies" in cleaned.notes[-1]
    assert not changed(cleaned, cleaned.clean(negative_damping=True)) - {"B"}
    np.testing.assert_allclose(cleaned.clean(negative_damping=True).B, cleaned.B, rtol=1e-9, atol=1e-6)
    # The nearest: no other positive matrix along the segment to any passive neighbour is closer in the scaled norm.
    scale = np.sqrt([np.abs(B[:, i, i]).max() for i in range(2)])

    def distance(matrix):
        return np.linalg.norm((matrix - data.B[101]) / np.outer(scale, scale))

    rng = np.random.default_rng(1)
    for _ in range(200):
        step = rng.normal(size=(2, 2)) * scale[:, None] * 0.05
        assert distance(cleaned.B[101] + step @ step.T) >= distance(cleaned.B[101]) - 1e-12


def test_symmetry_is_made_and_its_size_said():
    A = passive().A.copy()
    A[:, 0, 1] += 1.0e4
    data = full(A=A)
    cleaned = data.clean(symmetric=True)
    assert changed(data, cleaned) == {"A"}
    np.testing.assert_allclose(cleaned.A, 0.5 * (A + A.transpose(0, 2, 1)))
    size = 5.0e3 / np.sqrt(np.abs(A[:, 0, 0]).max() * np.abs(A[:, 1, 1]).max())
    assert f"A by up to {100 * size:.2g} %" in cleaned.notes[-1]


def test_spikes_bands_and_intervals_leave_out_whole_frequencies():
    B = passive().B.copy()
    B[80, 0, 0] += 0.2 * B[:, 0, 0].max()
    data = full(B=B)
    cleaned = data.clean(spikes=True)
    assert OMEGA[80] not in cleaned.omega and cleaned.omega.size > 230
    assert not {"spike", "irregular frequency"} & kinds(cleaned.check(), problems=False)
    cleaned = data.clean(band=(1.0, 8.0), drop=[(4.0, 4.1)])
    assert cleaned.omega[0] >= 1.0 and cleaned.omega[-1] <= 8.0
    assert not ((cleaned.omega >= 4.0) & (cleaned.omega <= 4.1)).any()
    assert cleaned.X.shape[0] == cleaned.B.shape[0] == cleaned.omega.size and len(cleaned.notes) == 2
    with pytest.raises(rss.InputError, match="lower end is above"):
        data.clean(band=(2.0, 1.0))
    with pytest.raises(rss.InputError, match="would be left"):
        data.clean(band=(20.0, 30.0))
    with pytest.raises(TypeError):
        data.clean(everything=True)


def test_A_inf_is_replaced_only_when_asked():
    data = full(A_inf=1.1 * A_INF)
    cleaned = data.clean(A_inf=True)
    assert changed(data, cleaned) == {"A_inf"}
    scale = np.abs(data.A - A_INF).max(axis=0)
    assert (np.abs(cleaned.A_inf - A_INF) < 0.02 * scale).all()
    assert "Heave" in cleaned.notes[-1]
    assert "there was none before" in full(A_inf=None).clean(A_inf=True).notes[-1]


@pytest.mark.parametrize("turn", [lambda data: data.replace(X=data.X.conj()),
                                  lambda data: data.replace(directions=data.directions + np.pi)])
def test_reversed_phases_or_headings_of_the_wave_force_are_named(data, tmp_path, caplog, turn):
    """Two public runs have them: pyHAMS' cylinder (phases of exp(-i w t)), an IEA-15 file with its heading reversed."""
    sound = rss.read_hydro(data / "bem" / "formats" / "sphere.out", rho=1000.0)
    assert "wave phase" not in {f.kind for f in sound.check().findings}
    bad = turn(sound)
    assert "wave phase" in {f.kind for f in bad.check().problems}
    rss.write_hydro(bad, tmp_path / "bad.nc")
    got = rss.read_hydro(tmp_path / "bad.nc")
    assert any("lags the elevation" in note for note in got.notes) and "lags the elevation" in caplog.text


def test_heaves_force_of_other_sign_beyond_the_long_waves_is_no_reversed_phase():
    """A spar's heave force goes through zero and comes back as large, with the other sign."""
    omega = np.linspace(0.05, 2.0, 60)
    heave = 4.0e6 * (1.0 - (omega / 0.5) ** 2) / (1.0 + (omega / 1.2) ** 4)
    surge = 3.0e6j * omega**2
    X = np.stack([surge, heave], axis=-1)[:, None, :]
    data = HydroData(omega, np.tile(1e7 * np.eye(2), (60, 1, 1)), np.tile(1e5 * np.eye(2), (60, 1, 1)),
                     dofs=("Surge", "Heave"), X=X, directions=[0.0], C=np.diag([0.0, 4.0e6]))
    assert np.abs(heave[omega > 0.6]).max() > 0.8 * 4.0e6
    assert "wave phase" not in {f.kind for f in data.check().findings}
    assert "wave phase" in {f.kind for f in data.replace(X=X.conj()).check().problems}


def dispersion(w, depth, g=9.81):
    """Return k and dw/dk, the one by bisection, the other by a difference."""
    def k(w):
        return brentq(lambda k: g * k * np.tanh(k * depth) - w**2, 1e-9, 1e3)
    return k(w), 2e-4 * w / (k(w * 1.0001) - k(w * 0.9999))


def with_far_field(half, depth=30.0):
    """Return coefficients whose damping is Haskind's integral; forces have harmonics of the heading up to the third."""
    dofs, omega = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"), np.linspace(0.15, 1.5, 28)
    rng = np.random.default_rng(2)
    beta = np.linspace(0.0, np.pi, 9) if half else 2.0 * np.pi * np.arange(16) / 16
    every = 2.0 * np.pi * np.arange(64) / 64

    def forces(beta, part):
        even, odd = (np.array([turn(m * beta) for m in range(4)]).T for turn in (np.cos, np.sin))
        mix = [(even if dof in ("Surge", "Heave", "Pitch") else odd) if half else even + odd for dof in dofs]
        return np.stack([m @ c for m, c in zip(mix, part)], axis=-1)

    parts = [(rng.normal(size=(6, 4)) + 1j * rng.normal(size=(6, 4))) * 1e6 * np.exp(-2.0 * w) for w in omega]
    X, B = np.array([forces(beta, part) for part in parts]), []
    for w, part in zip(omega, parts):
        k, speed = dispersion(w, depth)
        F = forces(every, part)
        B.append(k / (8.0 * np.pi * 1000.0 * 9.81 * speed) * 2.0 * np.pi / 64 * (F.T @ F.conj()).real)
    return HydroData(omega, np.tile(1e7 * np.eye(6), (omega.size, 1, 1)), B, dofs=dofs, X=X, directions=beta,
                     depth=depth, reference_point=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("half", [False, True])
def test_forces_and_damping_tell_the_depth(half):
    """OrcaFlex files have the depth of their model, WAMIT's .1 none: one public file each is of another depth."""
    data = with_far_field(half)
    assert not {"depth", "Haskind"} & {f.kind for f in data.check().findings}
    for wrong in (100.0, np.inf, 12.0):
        (found,) = (f for f in data.replace(depth=wrong).check().problems if f.kind in ("depth", "Haskind"))
        told = float(found.message.split("water of ")[1].split()[0])
        assert found.kind == "depth" and told == pytest.approx(30.0, rel=0.03)


@pytest.mark.parametrize("half", [False, True])
def test_forces_that_contradict_the_damping_are_named(half):
    data = with_far_field(half)
    X = data.X.copy()
    X[:, :, 4] *= 1.3                                   # a moment in another unit than its damping
    (found,) = (f for f in data.replace(X=X).check().problems if f.kind == "Haskind")
    assert "Pitch" in found.dofs
    few = data.replace(X=X[:, ::4], directions=data.directions[::4])
    assert "Haskind" not in {f.kind for f in few.check().findings}


def test_forces_of_half_a_circle_with_the_other_sign_are_named():
    """A public file of a ship has them: beyond 180 degrees the phases of sway, roll, pitch and yaw are conjugated."""
    data = with_far_field(False)
    X = data.X.copy()
    X[:, 9:, 1] = X[:, 9:, 1].conj()
    (found,) = (f for f in data.replace(X=X).check().problems if f.kind == "Haskind")
    assert "Sway" in found.dofs


@pytest.mark.parametrize("part, times, said", [
    ("X", 1.0, None), ("X", 1e-3, "wave force on Heave is"), ("X", 9.81, "wave force on Heave is"),
    ("X", 0.5, "wave force on Heave is 0.49"), ("X", 2.0, "wave force on Heave is 1.99"),
    ("X", 4.0, "and 4 times what its damping says; X is"),
    ("B", 1e-3, "damping of Heave is"), ("B", 1025.0, "damping of Heave is")])
@pytest.mark.parametrize("headings", [1, 8])
def test_a_force_or_damping_in_another_unit_is_told_by_long_waves(part, times, said, headings):
    """Deep water: k = w^2 / g, v_g = g / 2 w, so B = w^3 |X|^2 / (2 rho g^3); X = C at w = 0."""
    omega, rho, g = np.linspace(0.1, 2.0, 20), 1025.0, 9.81
    C = rho * g * np.pi * 25.0
    X = C * np.exp(-3.0 * omega[:, None, None] ** 2 / g)
    fields = {"X": X * np.ones((1, headings, 1)), "B": omega[:, None, None] ** 3 * X**2 / (2.0 * rho * g**3)}
    fields[part] = times * fields[part]
    data = HydroData(omega, np.full((20, 1, 1), 1e5), dofs=("Heave",), C=[[C]], rho=rho, **fields,
                     directions=2.0 * np.pi * np.arange(headings) / headings)
    found = [f.message for f in data.check().problems if f.kind == "scale"]
    walls = part == "B" and times > 1.0 and headings == 1  # a body between walls radiates more
    assert (said is None or walls) == (not found)
    assert not found or said in found[0]


@pytest.mark.parametrize("factor, unit", [
    (lambda w: 1e-3 + 0.0 * w, True), (lambda w: 0.02 * w**2, True), (lambda w: 1.0 / w**2, True),
    (lambda w: 1.0 + 0.3 * w**-3.0, False), (lambda w: 1e-3 + (w > 0.3), False)])
def test_a_damping_that_is_off_at_low_frequencies_only_is_in_no_other_unit(factor, unit):
    """Two ships of strip theory: 7 and 13 times what the forces say at 0.1 rad/s, as much as they say from 0.4 on."""
    omega, rho, g = np.linspace(0.1, 2.0, 20), 1025.0, 9.81
    C = rho * g * np.pi * 25.0
    X = C * np.exp(-3.0 * omega[:, None, None] ** 2 / g)
    B = factor(omega)[:, None, None] * omega[:, None, None] ** 3 * X**2 / (2.0 * rho * g**3)
    data = HydroData(omega, np.full((20, 1, 1), 1e5), B, dofs=("Heave",), X=X * np.ones((1, 8, 1)), C=[[C]], rho=rho,
                     directions=2.0 * np.pi * np.arange(8) / 8)
    (text,) = (f.message for f in data.check().problems if f.kind == "scale")
    assert ("in another unit" in text) == unit
    assert unit or (re.search(r", 1(\.\d+)? times as the median over the band, beyond 1.4 times in 0.1 to ", text))


@pytest.mark.parametrize("ripple", [0.0, 1e-9])
def test_an_added_mass_that_does_not_vary_with_a_damping_that_does_is_not_causal(ripple):
    """Measured by what the damping implies, not by the added mass's own range, which is nothing."""
    omega = np.linspace(0.2, 6.0, 80)
    A, B = 300.0 + ripple * omega, 500.0 * omega**2 * np.exp(-omega)
    found = rss.HydroData(omega, A[:, None, None], B[:, None, None], np.array([[300.0]]), ("Heave",)).check()
    value = next(f.value for f in found.findings if f.kind == "Kramers-Kronig" and f.problem)
    assert 0.5 < value < 2.0


def test_one_frequency_is_said_in_the_singular():
    one = rss.HydroData([1.0], np.ones((1, 1, 1)), np.ones((1, 1, 1)), [[1.0]], ("Heave",))
    assert "only 1 frequency; 8 are needed" in str(one.check()) and "1 frequency from" in str(one.check())
    with pytest.raises(rss.InputError, match="1 frequency; at least 3"):
        rss.fit_radiation(one)
