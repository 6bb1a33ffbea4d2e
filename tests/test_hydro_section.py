"""The section solver against closed forms, reference tables and physical laws that its equations do not contain."""

import contextlib
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import radiation_ss as rss
from radiation_ss.hydro import box_section, circle_section, read_section, solve_section

G = 9.81
RHO = 1000.0


def relative(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.fixture(scope="module")
def tank():
    """The paper's section: b = d = 0.1 m, area ratio 0.9, 0.45 m of water."""
    kb = np.array([1e-3, 0.05, 0.1, 0.3, 0.7, 1.0, 1.7, 3.0, 6.0])
    return solve_section(rss.lewis_section(0.1, 0.1, 0.9), np.sqrt(kb * G / 0.1), 0.45)


def test_semicircle_in_deep_water_against_the_reference_table(data):
    ref = np.genfromtxt(data / "reference" / "semicircle_deepwater.csv", delimiter=",", names=True)
    a = 2.0
    mass, tick = 0.5 * np.pi * RHO * a**2, np.sqrt(a / G)
    h = rss.section_2d(circle_section(a), ref["omega_sqrt_a_over_g"] / tick, panels=60)
    for dof, name in ((0, "22"), (1, "33")):
        suffix = "_bem" if dof == 0 else ""
        assert relative(h.A[:, dof, dof] / mass, ref[f"a{name}{suffix}"]) < 1e-4
        assert relative(h.B[:, dof, dof] / mass * tick, ref[f"b{name}{suffix}"]) < 2e-4


def assert_in_table(h, ref, bound, force_bound):
    """The coefficients of a section against a table of A, B and X by mode."""
    for name, i, j in (("22", 0, 0), ("33", 1, 1), ("44", 2, 2), ("24", 0, 2)):
        assert relative(h.A[:, i, j], ref[f"A{name}"]) < bound
        assert relative(h.B[:, i, j], ref[f"B{name}"]) < bound
    for i, name in enumerate("234"):
        expected = ref[f"X{name}_abs"] * np.exp(1j * np.deg2rad(ref[f"X{name}_lead_deg"]))
        assert relative(h.X[:, 0, i], expected) < force_bound


def test_lewis_section_in_deep_water_against_the_reference_table(data):
    ref = np.genfromtxt(data / "reference" / "lewis_H0_1_sigma_0p9_deepwater_per_metre.csv", delimiter=",", names=True)
    h = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), ref["omega_rad_s"], panels=60)
    assert_in_table(h, ref, 2e-4, 3e-4)


def test_a_ship_section_about_its_centre_of_gravity_against_the_reference_table(data):
    """The section of Sundsdal et al. (2025), 0.586 m long, roll about z = -0.092 m; z up, so A24 < 0 there."""
    ref = np.genfromtxt(data / "ntnu_section" / "bem_deepwater_L0p586.csv", delimiter=",", names=True)
    h = rss.section_2d(box_section(0.2, 0.2, 0.0512), ref["omega_rad_s"]).times(0.586).at((0.0, 0.0, -0.092))
    assert_in_table(h, ref, 1e-4, 2e-4)


def test_infinite_frequency_closed_forms():
    lewis = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), [1.0])
    assert lewis.A_inf[1, 1] == pytest.approx(1.183586 * RHO * np.pi * 0.1**2 / 2, rel=1e-6)
    circle = rss.section_2d(circle_section(1.0), [1.0])
    assert circle.A_inf[0, 0] == pytest.approx(4 / np.pi**2 * RHO * np.pi / 2, rel=1e-4)
    assert np.abs(circle.A_inf[2]).max() < 1e-3 * RHO  # a circle turns without moving water


def test_long_waves_in_finite_depth_have_the_shallow_water_damping(tank):
    assert tank.hydro.B[0, 1, 1] / RHO == pytest.approx(2 * 0.1**2 * np.sqrt(G / 0.45), rel=1e-3)


def test_the_tank_has_the_published_memory():
    """First row of Table 3 of Hanaki, Takaoka & Minoura (2022), read as L/rho per unit length in SI."""
    a1, a2, a3, b1, b2, b3 = 1130.3213, 230.9063, 22.0178, 105.7441, 12.9617, 0.5849
    kb = np.concatenate([[1e-4], np.linspace(0.1, 3.0, 60)])
    omega = np.sqrt(kb * G / 0.1)
    s = 1j * omega
    table = (b3 * s**2 + b2 * s + b1) / (s**3 + a3 * s**2 + a2 * s + a1)
    h = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), omega, 0.45)
    K = h.K[:, 1, 1] / RHO
    assert abs(K[0].real) == pytest.approx(b1 / a1, rel=0.01)
    assert relative(table[1:], K[1:]) < 0.02
    assert h.A_inf[1, 1] / (RHO * 0.1**2) == pytest.approx(1.9485, abs=1e-4)


def test_great_depth_is_deep_water():
    section, omega = rss.lewis_section(0.1, 0.1, 0.9), np.sqrt(np.array([0.1, 0.5, 1.0, 3.0]) * G / 0.1)
    deep, finite = rss.section_2d(section, omega), rss.section_2d(section, omega, 100.0)
    for name in ("A", "B", "X"):
        np.testing.assert_allclose(getattr(finite, name), getattr(deep, name), rtol=1e-4,
                                   atol=1e-4 * np.abs(getattr(deep, name)).max())


def test_energy_haskind_and_symmetry_hold_for_all_modes(tank):
    assert tank.checks.worst < 1e-3


def heaving_barge(omega, b, d, h, modes=80):
    """A33 and B33 of a rectangular section by matched eigenfunctions, under the body and beside it."""
    gap = h - d
    n = np.arange(1, modes)
    lam = n * np.pi / gap
    added, damping = [], []
    for w in omega:
        K = w**2 / G
        evanescent = [brentq(lambda x, K=K: x * np.sin(x * h) + K * np.cos(x * h), (m - 0.5) * np.pi / h, m * np.pi / h)
                      for m in range(1, 2 * modes)]
        k = np.concatenate([[brentq(lambda x, K=K: x * np.tanh(x * h) - K, 1e-9, K + 10 / h)],
                            -1j * np.array(evanescent)])
        norm = np.sqrt(0.5 * (h + np.sinh(2 * k * h) / (2 * k)))  # of cosh k(z + h) over the depth
        # overlap of cosh k_m(z + h) with 1 and with cos lam_n(z + h) over the gap
        first = np.sinh(k * gap) / k / norm
        other = (k[:, None] * np.sinh(k[:, None] * gap) * (-1.0) ** n / (k[:, None] ** 2 + lam**2)) / norm[:, None]
        overlap = np.concatenate([first[:, None], other], axis=1)
        # inner ((z + h)^2 - y^2) / (2 gap) + a_0 + sum a_n cosh(lam y) / cosh(lam b) cos lam(z + h); outer e^{-ik(y-b)}
        # equal velocities at y = b: -i k_m c_m = sum_n overlap (inner slope)
        slope = np.concatenate([[0.0], lam * np.tanh(lam * b)])
        C = overlap * slope / (-1j * k[:, None])
        c0 = overlap[:, 0] * (-b / gap) / (-1j * k)
        # potential over the gap, projected on 1 and cos
        size = np.concatenate([[gap], np.full(n.size, 0.5 * gap)])
        shape = np.concatenate([[gap**3 / 3], 2 * gap * (-1.0) ** n / lam**2]) / (2 * gap) - np.concatenate(
            [[b**2 / 2], 0 * lam])
        a = np.linalg.solve(np.diag(size) - overlap.T @ C, overlap.T @ c0 - shape)
        force = 2 * (gap * b / 2 - b**3 / (6 * gap) + a[0] * b + np.sum(a[1:] * np.tanh(lam * b) / lam * (-1.0) ** n))
        added.append(RHO * force.real)  # n_z = -1 on the bottom
        damping.append(-RHO * w * force.imag)
    return np.array(added), np.array(damping)


def test_a_barge_in_finite_depth_against_matched_eigenfunctions():
    omega = np.array([0.3, 0.8, 1.5, 2.5, 4.0])
    A, B = heaving_barge(omega, 1.0, 0.6, 1.5)
    h = rss.section_2d(box_section(1.0, 0.6), omega, 1.5, panels=120)
    assert relative(h.A[:, 1, 1], A) < 2e-3
    assert relative(h.B[:, 1, 1], B) < 2e-3


def test_irregular_frequencies_are_removed():
    """A box's interior resonance, k b = pi/2 with K = k coth k d, puts a pole into the equations without the lid."""
    b = d = 1.0
    K = np.pi / 2 / np.tanh(np.pi / 2)
    omega = np.sqrt(G * K * np.linspace(0.98, 1.02, 21))
    h = rss.section_2d(box_section(b, d, 0.2), omega)
    for values in (h.A[:, 1, 1], h.B[:, 1, 1]):
        fit = np.polyval(np.polyfit(omega - omega.mean(), values, 3), omega - omega.mean())
        assert np.abs(values - fit).max() < 1e-5 * np.abs(values).max()


@settings(max_examples=8)
@given(scale=st.floats(0.05, 50.0), ratio=st.floats(0.4, 2.5), area=st.floats(0.65, 0.95))
def test_froude_scaling(scale, ratio, area):
    kb = np.array([0.3, 1.0, 2.0])
    small = rss.section_2d(rss.lewis_section(ratio, 1.0, area), np.sqrt(kb * G), 4.0, panels=40)
    large = rss.section_2d(rss.lewis_section(ratio * scale, scale, area), np.sqrt(kb * G / scale), 4.0 * scale,
                           panels=40)
    arm = np.array([1.0, 1.0, scale])
    unit = RHO * scale**2 * np.outer(arm, arm)
    assert np.abs(large.A / unit - small.A / RHO).max() < 1e-5
    assert np.abs(large.B * np.sqrt(scale) / unit - small.B / RHO).max() < 1e-5
    assert np.abs(large.X[:, 0] / (scale * arm) - small.X[:, 0]).max() < 1e-5 * np.abs(small.X).max()


@settings(max_examples=10)
@given(ratio=st.floats(0.5, 2.0), area=st.floats(0.65, 0.95), depth=st.floats(1.3, 10.0))
def test_physical_relations_hold_for_any_lewis_form(ratio, area, depth):
    solution = solve_section(rss.lewis_section(ratio, 1.0, area), np.sqrt(np.array([0.05, 0.5, 2.0]) * G), depth)
    assert solution.checks.worst < 1e-3


def test_convergence_is_of_high_order():
    section, omega = rss.lewis_section(0.1, 0.1, 0.9), np.sqrt(np.array([0.2, 1.0, 3.0]) * G / 0.1)
    fine = rss.section_2d(section, omega, 0.45, panels=120)
    error = [relative(rss.section_2d(section, omega, 0.45, panels=n).A[:, 0, 0], fine.A[:, 0, 0]) for n in (10, 20, 40)]
    assert error[1] < error[0] / 2**4
    assert error[2] < error[1] / 2**5


def test_shapes_have_their_areas_and_hydrostatics():
    lewis = rss.lewis_section(0.3, 0.2, 0.85)
    assert (lewis.half_breadth, lewis.draft) == pytest.approx((0.3, 0.2))
    assert lewis.area == pytest.approx(0.85 * 2 * 0.3 * 0.2)
    assert circle_section(2.0).area == pytest.approx(2 * np.pi)
    box = box_section(1.0, 0.5, 0.1)
    assert box.area == pytest.approx(1.0 - 2 * (1 - np.pi / 4) * 0.01)
    turned = rss.section_2d(circle_section(1.0), [1.0], centre_of_gravity=0.0)
    assert turned.C[2, 2] == pytest.approx(0.0, abs=1e-9)  # a circle has no roll stiffness about its centre
    h = rss.section_2d(box_section(1.0, 0.5), [1.0], centre_of_gravity=-0.1, gyradius=0.7)
    assert h.C[1, 1] == pytest.approx(RHO * G * 2.0)
    assert h.C[2, 2] == pytest.approx(RHO * G * (2 / 3 + 1.0 * (-0.25 + 0.1)))
    about_g = h.at((0.0, 0.0, -0.1))
    np.testing.assert_allclose(about_g.M, np.diag([RHO, RHO, RHO * 0.49]), atol=1e-9)


def test_long_waves_lift_with_the_waterplane_stiffness_and_push_with_displaced_and_added_mass():
    h = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), [0.02], 0.45)
    assert h.X[0, 0, 1] == pytest.approx(h.C[1, 1], rel=2e-3)
    k = 0.02 / np.sqrt(G * 0.45)
    assert h.X[0, 0, 0] == pytest.approx(1j * k * G * (RHO * 0.018 + h.A[0, 0, 0]), rel=2e-3)


def test_a_free_section_follows_long_waves_and_an_energy_balance_holds():
    omega = np.concatenate([[0.02], np.linspace(2.0, 14.0, 25)])
    solution = solve_section(rss.lewis_section(0.1, 0.1, 0.9), omega, 0.45, centre_of_gravity=-0.05, gyradius=0.07)
    rao = solution.hydro.rao()[:, 0]
    kh = 0.02 * np.sqrt(0.45 / G)
    assert rao[0, 1] == pytest.approx(1.0, rel=2e-3)  # heaves with the surface
    assert rao[0, 0] == pytest.approx(-1j / kh, rel=5e-3)  # sways with the water
    # waves of the fixed body plus those that its motion makes carry away just what comes in
    field = solution.far_field
    made = np.einsum("wsi,wi->ws", field.radiated, 1j * omega[:, None] * rao)
    waves = np.stack([field.transmission, field.reflection], axis=1) + made
    np.testing.assert_allclose(np.sum(np.abs(waves) ** 2, axis=1), 1.0, atol=1e-5)


def test_motion_in_waves_names_what_is_missing():
    with pytest.raises(rss.InputError, match="M is missing"):
        rss.section_2d(circle_section(1.0), [1.0], panels=10).rao()


def offsets(section, n=41):
    t = np.linspace(0.0, 1.0, n)
    z = np.concatenate([arc.curve(t)[(i > 0):] for i, arc in enumerate(section.arcs)])
    return np.stack([z.real, z.imag], axis=1)


def test_offsets_in_any_order_give_the_section(tmp_path):
    exact = rss.section_2d(rss.lewis_section(1.0, 1.0, 0.9), [2.0, 4.0], 5.0)
    half = offsets(rss.lewis_section(1.0, 1.0, 0.9))
    other = half * [-1.0, 1.0]
    whole = np.concatenate([other[::-1], half[1:]])
    path = tmp_path / "section.csv"
    path.write_text("# a section\ny, z\n" + "\n".join(f"{y:.15g}, {z:.15g}" for y, z in half))
    for given_form in (half, half[::-1], other, whole, whole[::-1], path, half.tolist()):
        np.testing.assert_allclose(rss.section_2d(given_form, [2.0, 4.0], 5.0).A, exact.A, rtol=1e-4, atol=1e-4)


def test_offsets_with_a_chine_are_not_rounded():
    box = rss.section_2d([(0, -0.5), (1, -0.5), (1, 0)], [2.0])
    np.testing.assert_allclose(box.A, rss.section_2d(box_section(1.0, 0.5), [2.0]).A, rtol=1e-12)
    with_even_number = rss.section_2d([(-1, 0), (-1, -0.5), (1, -0.5), (1, 0)], [2.0])
    np.testing.assert_allclose(with_even_number.A, box.A, rtol=1e-12)


@pytest.mark.parametrize(("points", "message"), [
    ([(0, -1), (1, -1), (1, -0.2)], "must end on the waterline"),
    ([(0.3, -1), (1, -1), (1, 0)], "must start on the centre line"),
    ([(0, -1), (2, -0.2), (2, -0.8), (1, 0)], "crosses itself"),
    ([(0, -1), (1, 0.5), (2, 0)], "leaves the water"),
    ([(0, -1), (0, -1), (1, 0)], "twice"),
    ([(0, -1), (1, np.nan), (1, 0)], "finite"),
    ([(0, -1, 3), (1, 0, 3)], "shape"),
    ([(0, -1)], "n >= 2"),
    ([("a", "b"), ("c", "d")], "numbers"),
    ([(-1, 0), (-0.5, -1), (1, -1), (1, 0)], "not symmetric"),
    ([(0, 0), (1, 0)], "positive"),
])
def test_bad_sections_are_one_clear_error(points, message):
    with pytest.raises(rss.InputError, match=message):
        rss.section_2d(points, [1.0])


@pytest.mark.parametrize(("arguments", "message"), [
    ({"depth": 0.0}, "depth: must be positive"),
    ({"depth": 0.9}, "not more than the draft"),
    ({"depth": np.nan}, "depth"),
    ({"omega": [1.0, 1.0]}, "ascending"),
    ({"omega": [0.0, 1.0]}, "positive"),
    ({"omega": []}, "omega"),
    ({"omega": ["x"]}, "omega"),
    ({"omega": [1e-9, 1.0]}, "below 1e-6"),
    ({"depth": 1e300}, "use inf"),
    ({"rho": 0.0}, "rho"),
    ({"g": -1.0}, "g:"),
    ({"panels": 2}, "panels"),
    ({"centre_of_gravity": np.inf}, "centre_of_gravity"),
    ({"gyradius": 0.0}, "gyradius"),
])
def test_bad_arguments_are_one_clear_error(arguments, message):
    call = {"section": circle_section(1.0), "omega": [1.0], **arguments}
    with pytest.raises(rss.InputError, match=message):
        rss.section_2d(**call)


@pytest.mark.parametrize(("call", "message"), [
    (lambda: rss.lewis_section(0.0, 1.0, 0.9), "half_breadth"),
    (lambda: rss.lewis_section(1.0, 1.0, 1.3), "area_ratio"),
    (lambda: rss.lewis_section(1.0, "deep", 0.9), "draft"),
    (lambda: circle_section(1.0, 2.0), "submerges"),
    (lambda: box_section(1.0, 0.5, 0.6), "bilge_radius"),
])
def test_bad_shapes_are_one_clear_error(call, message):
    with pytest.raises(rss.InputError, match=message):
        call()


def test_a_contour_that_the_panels_do_not_resolve_is_an_error_not_a_result():
    fin = [(0.0, -0.5843), (0.6919, -0.2286), (0.9029, -0.0019), (0.592, -0.9212), (0.906, 0.0)]
    with pytest.raises(rss.SolverError, match="panels do not resolve it"):
        rss.section_2d(fin, [1.0, 3.0, 6.0], panels=20)


def test_a_section_passes_the_check_of_its_own_data():
    data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 40.0, 80), 0.45, panels=40)
    assert not [finding for finding in data.check().findings if finding.problem]


def test_a_file_error_names_file_and_line(tmp_path):
    path = tmp_path / "hull.txt"
    path.write_text("0 -1\n1 -1\n1 zero\n")
    with pytest.raises(rss.InputError, match=r"hull.txt, line 3"):
        rss.section_2d(path, [1.0])
    path.write_text("offsets of frame 12\ny z\n0 -1\n1 0\n")
    with pytest.raises(rss.InputError, match=r"hull.txt, line 2"):
        rss.section_2d(path, [1.0])
    with pytest.raises(rss.InputError, match="cannot be read"):
        rss.section_2d(tmp_path / "absent.txt", [1.0])


def test_units_that_an_offsets_file_states_are_converted(tmp_path):
    path = tmp_path / "hull.csv"
    for head, y, z in (("y [mm],z [mm]", 1e3, 1e3), ("y (cm),z (mm)", 1e2, 1e3), ("y,z [mm]", 1e3, 1e3),
                       ("frame (new)", 1, 1)):
        path.write_text(f"{head}\n0,{-0.1 * z}\n{0.1 * y},{-0.1 * z}\n{0.1 * y},0\n")
        assert read_section(path).area == pytest.approx(0.02)       # a box, 0.2 m wide and 0.1 m deep
    path.write_text("y [yd],z [yd]\n0,-0.1\n0.1,-0.1\n0.1,0\n")
    with pytest.raises(rss.InputError, match=r"line 1: the units of y and z in .* may be in m, cm, mm, ft, in"):
        read_section(path)


@settings(max_examples=80)
@given(content=st.one_of(st.text(max_size=80), st.text(alphabet="0123456789.-,; \n#eyznaif", max_size=80)))
def test_no_text_file_raises_anything_but_an_input_error(content, tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz") / "section.txt"
    path.write_bytes(content.encode("utf-8", "surrogatepass"))
    with contextlib.suppress(rss.InputError):
        read_section(path)


def test_a_progress_bar_goes_to_a_terminal_only(capsys, monkeypatch):
    sweep = np.linspace(0.5, 2.0, 200)
    solve_section(circle_section(1.0), sweep, panels=10)
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    solve_section(circle_section(1.0), sweep, panels=10)
    out, err = capsys.readouterr()
    assert out == ""
    assert "section" in err


def test_a_solution_pickles():
    solution = solve_section(box_section(1.0, 0.5, 0.1), [1.0, 2.0])
    again = pickle.loads(pickle.dumps(solution))
    np.testing.assert_array_equal(again.hydro.A, solution.hydro.A)
    assert again.section.area == solution.section.area
