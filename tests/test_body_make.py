"""A model from a few numbers: what comes out must do what the tests that the numbers are from did."""

from itertools import pairwise

import control as ct
import numpy as np
import pytest
from plant_bodies import tank_fit, tank_model

import radiation_ss as rss
from radiation_ss.body import natural_modes
from radiation_ss.cli import main
from radiation_ss.errors import InputWarning


def decay_of(model, period):
    """Return times and motion of a free decay, by python-control, from an offset of one."""
    time = np.linspace(0.0, 30.0 * period, 60001)
    start = np.zeros(model.fit.states + 2 * model.n)
    start[model.fit.states] = 1.0
    return time, ct.initial_response(rss.cummins(model), time, start).outputs[0]


def measured(time, x):
    """Return period and damping ratio as a tank reads them: zero crossings, logarithmic decrement of the crests."""
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    zero = time[up] - x[up] * np.diff(time)[0] / (x[up + 1] - x[up])
    crests = np.array([x[a:b].max() for a, b in pairwise(up[1:])])
    fall = np.log(crests[0] / crests[5]) / 5.0
    return np.diff(zero)[1:6].mean(), fall / np.hypot(fall, 2.0 * np.pi)


@pytest.mark.parametrize("numbers", [
    {"dof": "Roll", "mass": 993.0, "GM": 0.0843, "gyradius": 0.341, "period": 2.545, "damping_ratio": 0.0017},
    {"dof": "Heave", "mass": 10.0, "C": 4000.0, "period": 0.45, "damping_ratio": 0.08},
    {"dof": "Roll", "mass": 993.0, "GM": 0.0843, "period": 2.545, "damping_ratio": 0.05},
    {"dof": "Surge", "mass": 10.0, "added_mass": 3.0, "period": 12.0, "damping_ratio": 0.1},
    {"dof": "Heave", "period": 0.8, "damping_ratio": 0.2, "C": 600.0, "mass": 1.0, "radiation": tank_fit()}])
def test_the_model_decays_as_the_test_did(numbers):
    if "radiation" in numbers:
        numbers = {**numbers, "radiation": tank_fit().replace(A_inf=[[4.0]])}
        del numbers["mass"]
    model = rss.body(**numbers)
    found = natural_modes(model)
    assert found.period[0] == pytest.approx(numbers["period"], rel=1e-9)
    assert found.ratio[0] == pytest.approx(numbers["damping_ratio"], rel=1e-6)
    period, ratio = measured(*decay_of(model, numbers["period"]))
    assert period == pytest.approx(numbers["period"], rel=2e-3)
    assert ratio == pytest.approx(numbers["damping_ratio"], rel=0.02)


def test_added_inertia_of_the_tanker_by_hand():
    model = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545)
    whole = 993.0 * 9.81 * 0.0843 * (2.545 / (2.0 * np.pi)) ** 2
    assert model.A_inf[0, 0] == pytest.approx(whole - 993.0 * 0.341**2)
    assert model.D[0, 0] == 0.0 and model.fit.states == 0


def test_with_radiation_the_period_gives_the_stiffness():
    true = tank_model()
    modes = natural_modes(true)
    given = {"dof": "Heave", "radiation": true.fit.replace(A_inf=true.A_inf), "mass": true.M[0, 0],
             "period": modes.period[0]}
    assert rss.body(**given).C == pytest.approx(true.C, rel=1e-9)
    assert rss.body(**given).D[0, 0] == pytest.approx(0.0, abs=1e-6)
    more = natural_modes(rss.body(**given, damping_ratio=1.5 * modes.ratio[0]))
    assert more.ratio[0] == pytest.approx(1.5 * modes.ratio[0])
    with pytest.raises(rss.InputError, match="less than what radiation alone gives"):
        rss.body(**given, damping_ratio=0.5 * modes.ratio[0])
    known = {**given, "C": true.C[0, 0], "period": None}
    assert natural_modes(rss.body(**known, damping_ratio=0.3)).ratio[0] == pytest.approx(0.3, rel=1e-6)
    with pytest.raises(rss.InputError, match="less than what radiation alone gives"):
        rss.body(**known, damping_ratio=0.5 * modes.ratio[0])


@pytest.fixture(scope="module")
def barge():
    section = rss.section_2d([(0.0, -1.0), (1.0, -1.0), (1.0, 0.0)], np.linspace(0.3, 6.0, 40)).select("Sway")
    return rss.fit_radiation(section.times(5.0), 5)


def test_a_mooring_follows_from_the_period_though_hydrostatics_are_there(barge):
    """(2 pi / T)^2 (m + A) at T, of a body of little damping; the file's C is zero in sway, the one given is not."""
    assert barge.data.C[0, 0] == 0.0
    given, w = {"dof": "Sway", "mass": 1e4, "radiation": barge}, 2.0 * np.pi / 20.0
    added = barge.A_inf[0, 0] + barge.frequency_response(w)[0, 0, 0].imag / w
    assert rss.body(**given, period=20.0).C[0, 0] == pytest.approx(w**2 * (1e4 + added), rel=1e-3)
    assert rss.body(**given).C[0, 0] == 0.0
    with pytest.raises(rss.InputError, match="leave nothing for it to tell"):
        rss.body(**given, period=20.0, C=2000.0)


@pytest.mark.parametrize("period", [5.0, 8.0, 20.0])
def test_the_mode_of_a_motion_is_the_one_that_its_release_goes_by(barge, period):
    """In sway the body's velocity takes a large part in the radiation's own, heavily damped modes."""
    model = rss.body(dof="Sway", mass=1e4, radiation=barge, period=period)
    decayed, ratio = measured(*decay_of(model, period))
    found = natural_modes(model)
    assert found.period[0] == pytest.approx(period, rel=1e-6) and decayed == pytest.approx(period, rel=0.01)
    assert found.ratio[0] == pytest.approx(ratio, rel=0.1, abs=1e-3)


def test_an_overdamped_motion_has_no_period_though_its_radiation_swings(barge):
    model = rss.body(dof="Sway", mass=1e4, radiation=barge, period=20.0)
    assert np.isinf(natural_modes(model.attached(damping={"Sway": 5e4})).period[0])


@pytest.mark.parametrize("period", [2.0, 3.0])
def test_a_period_that_only_the_radiation_has_is_refused(barge, period):
    """The stiffness that gives a mode of 3 s lets the body swing by 8 s; that of 2 s pushes it away."""
    with pytest.raises(rss.InputError, match="that is released oscillates so"):
        rss.body(dof="Sway", mass=1e4, radiation=barge, period=period)


def test_a_section_with_its_length_is_the_box_of_archimedes():
    offsets = [(0.0, -0.2), (0.2, -0.2), (0.2, 0.0)]
    model = rss.body(section=offsets, length=0.586, GM=0.05, gyradius=0.12, dof=("Heave", "Roll"))
    mass = 1000.0 * 0.4 * 0.2 * 0.586
    assert np.diag(model.M) == pytest.approx([mass, mass * 0.12**2], rel=1e-6)
    assert np.diag(model.C) == pytest.approx([1000.0 * 9.81 * 0.4 * 0.586, mass * 9.81 * 0.05], rel=1e-6)
    assert model.fit.passive and model.A_inf[0, 0] > 0.2 * mass
    low = rss.body(section=offsets, length=0.586, centre_of_gravity=-0.1, dof="Roll", period=1.2)
    # BM = b^3 / 12 / area, KB = draft / 2: GM = zB + BM - zG.
    assert low.C[0, 0] == pytest.approx(mass * 9.81 * (-0.1 + 0.4**3 / 12.0 / 0.08 + 0.1), rel=1e-6)


def test_a_gyradius_means_the_same_whichever_motions_are_asked_for():
    """About G, moved to the axis by Steiner's theorem, where G is given; else about the axis."""
    box = {"section": [(0.0, -0.1), (0.1, -0.1), (0.1, 0.0)], "length": 1.0, "gyradius": 0.07}
    for arm, given in ((0.06, {"centre_of_gravity": -0.06}), (0.0, {"GM": 0.04})):
        alone, both = (rss.body(dof=dofs, **box, **given) for dofs in ("Roll", ("Sway", "Roll")))
        assert alone.M[0, 0] == pytest.approx(20.0 * (0.07**2 + arm**2), rel=1e-9)
        assert both.M == pytest.approx(np.array([[20.0, 20.0 * arm], [20.0 * arm, alone.M[0, 0]]]), rel=1e-9)
    data = rss.section_2d(box["section"], np.linspace(0.5, 20.0, 30), gyradius=0.07, centre_of_gravity=-0.06)
    numbers = {"radiation": data.at((0.0, 0.0, -0.02)), "mass": 20.0, "gyradius": 0.07, "centre_of_gravity": -0.06}
    moved, both = (rss.body(dof=dofs, **numbers) for dofs in ("Roll", ("Sway", "Roll")))
    assert moved.M[0, 0] == pytest.approx(20.0 * (0.07**2 + 0.04**2), rel=1e-9)
    assert both.M[1, 1] == pytest.approx(moved.M[0, 0], rel=1e-9)


def test_several_degrees_of_freedom_each_by_its_own_numbers():
    model = rss.body(dof=("Surge", "Heave", "Pitch"), mass=100.0, gyradius=0.5, GM=0.3, C={"Heave": 2000.0},
                     period={"Heave": 1.6, "Pitch": 2.0}, added_mass={"Surge": 10.0})
    assert np.diag(model.C) == pytest.approx([0.0, 2000.0, 100.0 * 9.81 * 0.3])
    assert natural_modes(model).period == pytest.approx([np.inf, 1.6, 2.0])


def test_a_centre_of_gravity_is_a_height(barge):
    section, point = [(0.0, -1.0), (1.0, -1.0), (1.0, 0.0)], (0.0, 0.0, -0.5)
    for call in (lambda: rss.section_2d(section, [1.0, 2.0], centre_of_gravity=point),
                 lambda: rss.body(section=section, length=5.0, dof="Heave", centre_of_gravity=point),
                 lambda: rss.body(dof="Sway", mass=1e4, radiation=barge, centre_of_gravity=point)):
        with pytest.raises(rss.InputError, match=r"centre_of_gravity: \(0.0, 0.0, -0.5\); one number is needed"):
            call()


def test_a_guess_travels_to_what_follows_from_it():
    given = {"dof": "Roll", "mass": 993.0, "GM": 0.0843, "gyradius": 0.341, "period": 2.545}
    found = rss.body(**given, tolerance={"gyradius": 0.01, "kernel": 0.2}).tolerance
    M = 993.0 * 0.341**2
    A = rss.body(**given).A_inf[0, 0]
    assert dict(found) == pytest.approx({"mass": 0.0201, "A_inf": 0.0201 * M / A, "kernel": 0.2}, rel=1e-6)
    both = rss.body(**given, tolerance={"GM": 0.03, "mass": 0.04}).tolerance
    assert both["stiffness"] == pytest.approx(0.05, rel=1e-6)
    assert rss.body(**given, tolerance={"stiffness": 0.03}).tolerance["A_inf"] > 0.1


def test_a_metacentric_height_in_millimetres_is_doubted():
    with pytest.warns(InputWarning, match=r"added inertia .*e\+03 times the body's; check the period \[s\], and GM"):
        rss.body(dof="Roll", mass=993.0, GM=84.3, gyradius=0.341, period=2.545)


@pytest.mark.parametrize("numbers, words", [
    ({"dof": "Roll", "mass": 1.0, "gm": 1.0}, "did you mean GM"),
    ({"dof": "Heave", "mass": 1.0, "stiffness": 4.0}, "'stiffness' is unknown; did you mean C"),
    ({"dof": "Bend", "mass": 1.0}, r"'Bend' is none of .*units=\{'Bend': 'm'\} or 'rad', --dof Bend=m"),
    ({"dof": "flap", "units": {"flap": "deg"}, "mass": 1.0}, "'flap' is none of .*units="),
    ({"dof": "flap", "units": {"flap": "rad"}, "mass": 1.0, "C": 4.0}, "gyradius of flap"),
    ({"dof": "flap", "units": {"flap": "rad"}, "mass": 1.0, "GM": 4.0}, "GM: means nothing for flap"),
    ({"dof": "pump", "units": {"pump": "m"}, "mass": 1.0, "C": 1.0, "gyradius": 4.0}, "means nothing for pump"),
    ({"dof": "pump", "units": {"pump": "m"}, "mass": 1.0}, r"C of pump: missing; give C \[N/m or N m/rad\]$"),
    ({"mass": 1.0}, "name the degrees of freedom"), ({"dof": "Heave", "weight": 1.0}, "'weight' is unknown"),
    ({"dof": "Heave", "mass": -1.0}, "positive"), ({"dof": "Heave", "mass": "x"}, "not a number"),
    ({"dof": "Heave", "mass": 1.0, "C": 4.0, "period": 0.1}, "shorter than 3.142 s"),
    ({"dof": "Heave", "mass": 1.0, "C": 4.0, "period": 9.0, "added_mass": 1.0}, "leave nothing"),
    ({"dof": "Heave", "mass": 1.0, "period": 9.0}, "give one more"), ({"dof": "Heave", "mass": 1.0}, "C of Heave"),
    ({"dof": "Heave", "mass": 1.0, "C": 4.0}, "added_mass of Heave"),
    ({"dof": "Roll", "mass": 1.0, "C": 4.0}, "gyradius of Roll"), ({"dof": "Heave", "mass": 1.0, "GM": 4.0}, "GM"),
    ({"dof": "Roll", "GM": 4.0, "period": 1.0}, "needs the mass"),
    ({"dof": "Roll", "mass": 1.0, "C": -4.0, "gyradius": 1.0, "period": 1.0}, "does not oscillate"),
    ({"dof": "Surge", "mass": 1.0, "added_mass": 1.0, "damping_ratio": 0.1}, "without stiffness"),
    ({"dof": ("Heave", "Roll"), "mass": 1.0, "C": 4.0}, "each degree of freedom"),
    ({"dof": "Heave", "mass": 1.0, "C": 4.0, "period": 9.0, "damping_ratio": 5.0}, "5 % of|0.05 is 5 %"),
    ({"dof": "Heave", "section": [(0, -1), (1, 0)]}, "length"), ({"dof": "Heave", "length": 1.0}, "section"),
    ({"dof": "Heave", "mass": 1.0, "C": 4.0, "period": 9.0, "tolerance": {"GM": 0.1}}, "'GM' is not among"),
])
def test_what_does_not_make_a_model_is_said(numbers, words):
    with pytest.raises(rss.InputError, match=words):
        rss.body(**numbers)


@pytest.mark.parametrize("unit, alike, numbers", [
    ("m", "Heave", {"mass": 10.0, "C": 4000.0, "period": 0.45, "damping_ratio": 0.08}),
    ("rad", "Roll", {"mass": 993.0, "C": 821.0, "gyradius": 0.341, "period": 2.545, "damping_ratio": 0.0017})])
def test_a_motion_of_one_s_own_is_like_a_rigid_body_s_of_its_unit(tmp_path, unit, alike, numbers):
    own, rigid = rss.body(dof="bob", units={"bob": unit}, **numbers), rss.body(dof=alike, **numbers)
    assert own.dofs == ("bob",) and "SI" in str(own)
    for name in ("M", "A_inf", "C", "D"):
        assert getattr(own, name)[0, 0] == getattr(rigid, name)[0, 0]
    words = [word for name, value in numbers.items()
             for word in (f"--{'stiffness' if name == 'C' else name.replace('_', '-')}", str(value))]
    assert main(["model", "--dof", f"bob={unit}", *words, "--out", str(tmp_path / "bob.nc")]) == 0
    np.testing.assert_allclose(rss.read_model(tmp_path / "bob.nc").M, own.M)
    joint = rss.RadiationFit(("bob", "Heave"), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0)
    with pytest.raises(rss.InputError, match="mass: does not tell how bob is coupled"):
        rss.body(radiation=joint.replace(A_inf=np.eye(2)), units={"bob": unit}, mass=1.0, C={"bob": 1.0, "Heave": 2.0})


def test_command_line_makes_the_same_model(tmp_path, capsys):
    out = tmp_path / "kv.nc"
    assert main(["model", "--dof", "Roll", "--mass", "993", "--gm", ".0843", "--gyradius", ".341", "--period", "2.545",
                 "--damping-ratio", ".0017", "--tolerance", "gm=.02", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "period 2.545 s, damping ratio 0.0017" in said and len(said.splitlines()) <= 11
    made = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.0017,
                    tolerance={"GM": 0.02}, name="kv")
    assert repr(rss.read_model(out)) == repr(made)
    assert main(["model", "--dof", "Roll", "--mass", "993", "--out", str(out)]) == 2
    assert "C of Roll" in capsys.readouterr().err


def test_the_package_and_the_function_share_a_name():
    from radiation_ss.body import cummins

    assert cummins is rss.cummins and rss.body(dof="Heave", mass=1.0, C=1.0, added_mass=0.0).n == 1


def test_a_system_of_python_control_is_a_body():
    names = {"inputs": ["heave_force"], "outputs": ["heave", "heave_vel", "heave_acc"]}
    system = ct.ss([[0.0, 1.0], [-40.0, -0.4]], [[0.0], [0.2]], [[1.0, 0.0], [0.0, 1.0], [-40.0, -0.4]],
                   [[0.0], [0.0], [0.2]], **names)
    model = rss.body(system, tolerance=0.05, name="buoy")
    assert (model.name, model.C[0, 0], model.tolerance["mass"]) == ("buoy", pytest.approx(200.0), 0.05)
    with pytest.raises(rss.InputError, match="give one of the two"):
        rss.body(system, mass=5.0)


@pytest.mark.parametrize("tolerance", [2.0, "5 %", {"mass": "5 %"}, {"mass": -0.1}])
def test_a_tolerance_is_a_share(tolerance):
    with pytest.raises(rss.InputError, match="a share between 0 and 1"):
        rss.body(dof="Heave", mass=5.0, added_mass=1.0, C=200.0, tolerance=tolerance)


@pytest.mark.parametrize("numbers, words", [
    ({"dof": "Roll", "mass": 993.0, "GM": 0.0843, "period": 2200.0}, r"Roll: .*radius of gyration.*period \[s\]"),
    ({"dof": "Roll", "mass": 993.0, "GM": 0.0843, "gyradius": 341.0, "added_mass": 0.0}, r"gyradius \[m\]"),
    ({"dof": "Heave", "mass": 993.0, "added_mass": 900.0, "period": 2200.0}, r"Heave: .* deep.*period \[s\]"),
    ({"dof": "Heave", "mass": 993.0, "added_mass": 900.0, "C": 3.0}, r"C \[N/m\]"),
    ({"dof": "Heave", "mass": 0.993, "added_mass": 0.9, "C": 2e4}, r"Heave: .* deep.*mass \[kg\]"),      # in tonnes
    ({"dof": "Heave", "mass": 4, "section": [(0.0, -0.1), (0.1, -0.1), (0.1, 0.0)], "length": 2.0}, "displaces 40 kg"),
])
def test_numbers_of_a_body_of_another_size_are_named(numbers, words):
    with pytest.warns(InputWarning, match=words):
        rss.body(**numbers)


@pytest.mark.parametrize("mass, C", [(8.07e6, 1025.0 * 9.81 * 33.2), (2.2e8, 1025.0 * 9.81 * 1100.0), (1.4e7, 3.8e6)])
def test_slender_bodies_are_taken_as_they_are(mass, C):
    """Hywind (Jonkman 2010), a classic spar, the DeepCwind semisubmersible (Robertson 2014)."""
    assert rss.body(dof="Heave", mass=mass, added_mass=mass, C=C).C[0, 0] == C


def test_a_tolerance_that_no_body_could_use_up_is_still_carried():
    """With 10 % more gyradius the body would be slower than the decay said, without any added inertia."""
    numbers = {"dof": "Pitch", "mass": 100.0, "GM": 0.1, "gyradius": 0.3, "period": 2.0}
    model = rss.body(**numbers, tolerance={"gyradius": 0.1})
    assert model.M == pytest.approx(rss.body(**numbers).M)
    assert model.tolerance["mass"] == pytest.approx(1.0 - 1.1**-2)


@pytest.mark.parametrize("units, what", [({"GM": "mm"}, "GM"), ({"Heave": "mm"}, "Heave")])
def test_units_of_what_is_always_si_are_refused(units, what):
    with pytest.raises(rss.InputError, match=f"units of {what}: .*SI"):
        rss.body(dof="Heave", mass=100.0, added_mass=80.0, C=2e3, units=units)


@pytest.mark.parametrize("scale, length, rho, words", [
    (1e3, 2.0, 1e3, "half breadth is 250 m"), (1.0, 2e3, 1e3, "length: 2000 m")])
def test_a_section_in_other_units_than_its_length_is_doubted(scale, length, rho, words):
    offsets = scale * np.array([[0.0, -0.2], [0.25, -0.2], [0.25, 0.0]])
    with pytest.warns(InputWarning, match=words):
        rss.body(dof="Heave", section=offsets, length=length, rho=rho)
    with pytest.raises(rss.InputError, match=r"rho: 1.025 kg/m\^3 found.*looks like t/m\^3"):
        rss.body(dof="Heave", section=offsets, length=length, rho=1.025)
