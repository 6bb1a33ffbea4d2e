"""More programs' files, and files as other people have them: read whole and right, or refused."""

import gzip
import re

import hydro_samples as samples
import numpy as np
import pytest
from scipy.linalg import block_diag

import radiation_ss as rss
from radiation_ss.reading import read_mat

RIGID = np.block([[5e5 * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), np.diag([1e6, 2e6, 3e6]) + 1e5]])


def plain_body(**changes):
    """Return coefficients whose M is a rigid body's and whose C holds heave, roll and pitch only."""
    data = samples.body_data(M=RIGID, **changes)
    C = np.zeros((6, 6))
    C[2:5, 2:5] = data.C[2:5, 2:5]
    return data.replace(C=C)


def assert_close(got, want, fields, rtol=1e-8):
    for name in fields:
        first, second = getattr(got, name), getattr(want, name)
        np.testing.assert_allclose(first, second, rtol=rtol, atol=rtol * np.abs(second).max(), err_msg=name)


@pytest.mark.parametrize("kind", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("depth", [35.0, np.inf])
def test_hams_run_whatever_its_frequencies_are_written_as(tmp_path, kind, depth):
    data = samples.body_data(depth=depth)
    got = rss.read_hydro(samples.hams(data, tmp_path, kind))
    assert (got.rho, got.g, got.depth, got.reference_point) == (1025.0, 9.80665, depth, data.reference_point)
    assert_close(got, data, ("omega", "A", "B", "X", "C", "M", "directions"))
    assert_close(rss.read_hydro(tmp_path / "Input" / "ControlFile.in"), data, ("omega", "A"))


def test_hydrostar_folder(tmp_path):
    data = samples.body_data()
    got = rss.read_hydro(samples.hydrostar(data, tmp_path, wave_at=(3.0, -1.0)))
    assert (got.rho, got.g, got.depth, got.reference_point) == (data.rho, data.g, data.depth, data.reference_point)
    assert_close(got, data, ("omega", "A", "B", "X", "directions"))
    path = tmp_path / "WaveDamping_35.rao"
    path.write_text(path.read_text().replace("1025.0000", "1000.0000"))
    with pytest.raises(rss.InputError, match=r"WaveDamping_35.rao: its head"):
        rss.read_hydro(tmp_path / "AddedMass_11.rao")
    path.unlink()
    with pytest.raises(rss.InputError, match=r"WaveDamping_35.rao: missing"):
        rss.read_hydro(tmp_path)


@pytest.mark.parametrize("units", samples.UNITS)
@pytest.mark.parametrize("convention, waves", [("leads", "frequency (rad/s)"), ("lags", "period (s)")])
@pytest.mark.parametrize("wave_at", [(3.0, -1.0), None])
def test_orcaflex_units_signs_and_phases(tmp_path, units, convention, waves, wave_at):
    data = plain_body(reference_point=(2.5, 0.5, -2.0))
    got = rss.read_hydro(samples.orcaflex(data, tmp_path, units, convention, waves, wave_at))
    np.testing.assert_allclose((got.rho, got.g, got.depth), (data.rho, data.g, data.depth), rtol=1e-12)
    assert got.reference_point == data.reference_point
    assert_close(got, data, ("omega", "A", "B", "A_inf", "X", "C", "M", "directions"))
    # The depth of the model: a vessel type does not say for which one it was computed.
    assert "coefficients may be of another" in " ".join(got.notes)
    assert rss.read_hydro(got.source, depth=31.0).depth == 31.0


@pytest.mark.parametrize("relative", samples.CROSSING)
@pytest.mark.parametrize("convention", ["leads", "lags"])
def test_orcaflex_phases_over_another_point_of_the_wave(tmp_path, relative, convention):
    """A published pair (mafredo, refcase_ofx): 250.773 degrees behind the crest, 199.227 before the down-crossing."""
    assert np.isclose((-250.773 + samples.CROSSING["zero down-crossing"]) % 360.0, 199.227)
    data = plain_body(reference_point=(2.5, 0.5, -2.0))
    got = rss.read_hydro(samples.orcaflex(data, tmp_path, convention=convention, relative=relative))
    assert_close(got, data, ("X",))


def test_orcaflex_two_forces_for_one_direction_are_refused(tmp_path):
    path = samples.orcaflex(plain_body(), tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    places = [k for k, line in enumerate(lines) if "RAODirection" in line]
    lines[places[1]] = lines[places[0]]
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(rss.InputError, match="yml: directions: 0 and 0 deg are one direction"):
        rss.read_hydro(path)


def test_orcaflex_rows_of_many_lines_older_names_and_several_vessels(tmp_path):
    """As OrcaFlex 11 lays its files out: a number on each line, the last with a comma, an empty list below its name."""
    data = plain_body(reference_point=(2.5, 0.5, -2.0))
    path = samples.orcaflex(data, tmp_path)
    lines = [re.sub(r"\]$", ",\n]", line.replace(", ", ",\n    ")) if line.strip()[:1] == "-" and "[" in line else line
             for line in path.read_text(encoding="utf-8").replace(",\n", ", ").splitlines()]
    lines.insert(lines.index("        LoadRAOs:"), "        QTFs:\n          One, Two:\n            []")
    text = "\n".join(lines).replace("CentreOfMass", "CentreOfGravity")
    path.write_text(text + "\n", encoding="utf-8")
    fields = ("omega", "A", "B", "A_inf", "X", "C", "M", "directions")
    assert_close(rss.read_hydro(path), data, fields)
    head, vessel, rest = re.match(r"(.*\n)(  - Name: Vessel type1\n.*)(    WireFrame.*)", text, re.DOTALL).groups()
    path.write_text(head + vessel.replace("type1", "other") + vessel + rest, encoding="utf-8")
    assert_close(rss.read_hydro(path, vessel="Vessel type1"), data, fields)
    with pytest.raises(rss.InputError, match=r"Vessel other, Vessel type1.*give vessel="):
        rss.read_hydro(path)
    with pytest.raises(rss.InputError, match="vessel is for OrcaFlex"):
        rss.read_hydro(samples.aqwa(data, tmp_path), vessel="Vessel type1")


def test_damping_that_is_no_radiation_and_tables_that_orcaflex_does_not_use_are_said(tmp_path, caplog):
    data = plain_body(reference_point=(0.0, 0.0, -2.0))
    path = samples.aqwa(data, tmp_path)
    for values, said in (("0 0 0 0 0 0", 0), ("0 0 250 0 0 0", 1)):
        path.write_text(path.read_text().replace("MASS\n", f"FIDD\n 1 {values}\nMASS\n", 1))
        got = rss.read_hydro(path)
        assert sum("FIDD" in note and "250" in note for note in got.notes) == said
        assert_close(got, data, ("B",))
        path = samples.aqwa(data, tmp_path)
    assert "FIDD" in caplog.text
    path = samples.orcaflex(data, tmp_path)
    text = path.read_text(encoding="utf-8")
    for method, said in (("Frequency dependent", 0), ("Constant", 1)):
        stated = text.replace("        Mass:", f"        AMDMethod: {method}\n        Mass:", 1)
        path.write_text(stated, encoding="utf-8")
        assert sum("AMDMethod is 'Constant'" in note for note in rss.read_hydro(path).notes) == said


def test_orcaflex_draughts_are_chosen_by_name(tmp_path):
    data = plain_body(reference_point=(2.5, 0.5, -2.0))
    path = samples.orcaflex(data, tmp_path)
    head, draught, rest = re.match(r"(.*Draughts:\n)(      - Name: Draught1\n.*)(    WireFrame.*)", path.read_text(),
                                   re.DOTALL).groups()
    ballast = re.sub(r"( Mass: )(\S+)", lambda m: f"{m[1]}{2.0 * float(m[2]):.12g}", draught)
    path.write_text(head + draught + ballast.replace("Draught1", "Ballast") + rest)
    with pytest.raises(rss.InputError, match=r"2 draughts with \w+ \(Draught1, Ballast\); give draught= one of"):
        rss.read_hydro(path, vessel="Vessel type1")
    assert_close(rss.read_hydro(path, draught="Draught1"), data, ("A", "M"))
    assert rss.read_hydro(path, draught="Ballast").M[0, 0] == pytest.approx(2.0 * data.M[0, 0])
    with pytest.raises(rss.InputError, match="no vessel type 'Full' with"):
        rss.read_hydro(path, draught="Full")


def test_orcaflex_groups_of_bodies_are_told(tmp_path):
    """As OrcaFlex names them: the group's tables stand in for those of the vessel types."""
    data = plain_body(reference_point=(2.5, 0.5, -2.0))
    path = samples.orcaflex(data, tmp_path)
    path.write_text(path.read_text() + "MultibodyGroups:\n  - Name: Group1\n    Bodies:\n      - Name: A\n")
    got = rss.read_hydro(path)
    assert_close(got, data, ("A", "B", "C"))
    assert "vessel type Vessel type1 alone, without other bodies" in " ".join(got.notes)
    path.write_text(path.read_text().replace("FrequencyDependentAddedMassAndDamping", "OtherName"))
    with pytest.raises(rss.InputError, match=r"MultibodyGroups \(line \d+\) hold those of bodies beside each other"):
        rss.read_hydro(path)


def test_orcawave_input_is_no_result(tmp_path):
    path = tmp_path / "model.yml"
    path.write_text("General:\n  UnitsSystem: SI\nBodies:\n  - BodyName: A\n")
    with pytest.raises(rss.InputError, match="not its input"):
        rss.read_hydro(path)


def test_aqwa_listing(tmp_path):
    data = plain_body()
    got = rss.read_hydro(samples.aqwa_lis(data, tmp_path))
    assert (got.rho, got.g, got.depth, got.reference_point) == (data.rho, data.g, data.depth, data.reference_point)
    assert_close(got, data, ("omega", "A", "B", "A_inf", "X", "C", "M", "directions"))


def two_bodies():
    data = samples.body_data(("body1", "body2"), reference_point=(np.nan,) * 3)
    stiffness = np.zeros((12, 12))
    for k in (2, 8):
        stiffness[k:k + 3, k:k + 3] = data.C[k:k + 3, k:k + 3]
    return data.replace(C=stiffness, M=block_diag(RIGID, 2.0 * RIGID))


def test_aqwa_listing_of_two_structures_and_the_ah1_beside_it(tmp_path):
    data, centres = two_bodies(), ((0.0, 0.0, -2.0), (7.0, -3.0, -1.0))
    path = samples.aqwa_lis(data, tmp_path, centres)
    got = rss.read_hydro(path)
    fields = ("omega", "A", "B", "A_inf", "X", "C", "M", "directions")
    assert got.dofs == data.dofs and np.isnan(got.reference_point).all()
    assert_close(got, data, fields)
    assert_close(got, rss.read_hydro(samples.aqwa(data, tmp_path, centres)), fields)


@pytest.mark.parametrize("page, sentence", [("H/I ADDED MASS FOR FORCE ON STR#  2", "is missing; cut off"),
                                            ("THE CENTRE OF GRAVITY  AT", "of structures"),
                                            ("FROUDE KRYLOV + DIFFRACTION", "for 2 structure")])
def test_aqwa_listing_of_two_structures_that_lacks_something(tmp_path, page, sentence):
    path = samples.aqwa_lis(two_bodies(), tmp_path, ((0.0, 0.0, -2.0), (7.0, -3.0, -1.0)))
    head, _, tail = path.read_text().partition(page)
    path.write_text(head + "(left out)" + tail)
    with pytest.raises(rss.InputError, match=sentence):
        rss.read_hydro(path)


def test_aqwa_listing_of_version_14_and_one_that_is_cut_off(tmp_path):
    """As a dynamic positioning simulator's (mind-ocean/DP-simulator): the whole point is on the hydrostatic page."""
    data, centres = two_bodies(), ((0.0, 0.0, -2.0), (7.0, -3.0, -1.0))
    path = samples.aqwa_lis(data, tmp_path, centres)
    pages = "".join(f"""1
  * * * * H Y D R O S T A T I C   P R O P E R T I E S   I N   T H E   F R E E   F L O A T I N G
                                       * * * * F O R   S T R U C T U R E   {k} * * * *
                                     C.O.G       GX=   {x:7.4f}  GY=   {y:7.4f}  GZ=   {z:7.4f}
""" for k, (x, y, z) in enumerate(centres, 1))
    old = re.sub(r"THE CENTRE OF GRAVITY  AT .*(\S+)\)", r"Z POSITION OF THE CENTRE OF GRAVITY  . =  \1",
                 path.read_text())
    first = re.search(r"1\n.*H Y D R O D Y N A M I C", old).start()
    path.write_text(old[:first] + pages + old[first:])
    assert_close(rss.read_hydro(path), data, ("omega", "A", "B", "X", "C", "M"))
    path.write_text(old[:first] + pages)
    with pytest.raises(rss.InputError, match="a stiffness, or any added mass is missing; cut off"):
        rss.read_hydro(path)
    path.write_text(old[:first])
    with pytest.raises(rss.InputError, match=r"centres of gravity .* of no structure; .*cut off"):
        rss.read_hydro(path)


def test_aqwa_listing_whose_high_frequency_has_no_coupling_gives_no_a_inf(tmp_path):
    path = samples.aqwa_lis(two_bodies(), tmp_path, ((0.0, 0.0, -2.0), (7.0, -3.0, -1.0)))
    head, mark, tail = path.read_text().partition("F O R   S T R U C T U R E   1\n")
    path.write_text(head + mark + tail.replace("H/I ADDED MASS FOR FORCE", "OTHER"))
    got = rss.read_hydro(path)
    assert got.A_inf is None and "no coupling" in " ".join(got.notes)


def generalised(folder, most=10, length=1.0):
    """Write a run of one body whose modes above 6 are generalised: of two bodies' files the modes up to `most`."""
    data = samples.body_data(("body1", "body2"))
    path = samples.wamit(data, folder, length=length)
    for suffix, columns in ((".1", (1, 2)), (".3", (2,)), (".hst", (0, 1))):
        lines = path.with_suffix(suffix).read_text().splitlines()
        kept = lines[:1] + [line for line in lines[1:] if max(int(line.split()[k]) for k in columns) <= most]
        path.with_suffix(suffix).write_text("\n".join(kept) + "\n")
    return path, data.select(list(data.dofs[:most]))


def test_generalised_modes_of_one_body(tmp_path):
    path, data = generalised(tmp_path)
    got = rss.read_hydro(path, rho=1025.0, g=9.80665, depth=35.0)
    assert got.dofs == (*data.dofs[0].replace("body1__", "").split(), "Sway", "Heave", "Roll", "Pitch", "Yaw",
                        "Mode7", "Mode8", "Mode9", "Mode10")
    assert "generalised" in " ".join(got.notes)
    assert_close(got, data, ("omega", "A", "B", "X", "C"))
    path.with_suffix(".hst").unlink()
    with pytest.raises(rss.InputError, match=r"which are generalised cannot be told.*NEWMDS = 0"):
        rss.read_hydro(path)


def test_generalised_modes_with_another_length_scale_are_refused(tmp_path):
    path, _ = generalised(tmp_path, length=2.0)
    with pytest.raises(rss.InputError, match="ULEN = 1"):
        rss.read_hydro(path, length=2.0)


def test_indented_nemoh_cal_and_out_wamit(tmp_path):
    data = samples.body_data(A_inf=None)
    folder = samples.nemoh(data, tmp_path / "run")
    cal = folder / "Nemoh.cal"
    cal.write_text("".join(f"  {line}" for line in cal.read_text().splitlines(keepends=True)))
    assert_close(rss.read_hydro(folder), data, ("A", "B", "X"))
    data = samples.body_data()
    out = samples.wamit_out(data, tmp_path)
    other = out.rename(out.with_name("body.out.wamit"))
    other.write_text(other.read_text().replace(" ", "\t"))
    assert_close(rss.read_hydro(other, rho=1025.0), data, ("omega", "A", "B", "A_inf"))
    plain = rss.read_hydro(samples.wamit_out(data, tmp_path), rho=1025.0)
    assert np.any(plain.C) and np.array_equal(rss.read_hydro(other, rho=1025.0).C, plain.C)


def test_dataset_in_and_out_and_what_a_notebook_shows():
    data = samples.body_data(("float", "spar"))
    dataset = data.to_xarray()
    before = dataset.copy(deep=True)
    got = rss.read_hydro(dataset)
    assert_close(got, data, ("omega", "A", "B", "A_inf", "X", "C", "M"), rtol=1e-15)
    assert dataset.identical(before)
    with pytest.raises(rss.InputError, match="dataset: rho = 1000 given, but the file says 1025"):
        rss.read_hydro(dataset, rho=1000.0)
    with pytest.raises(rss.InputError, match=r"an xarray\.Dataset is needed, found int"):
        rss.read_hydro(3)
    noted = data.replace(notes=tuple("a long note " * 30 for _ in range(9)))
    assert len(repr(noted).splitlines()) <= 10 and max(map(len, repr(noted).splitlines())) < 160
    assert "float__Surge" in repr(noted) and "6 more" in repr(noted)
    html = noted._repr_html_()
    assert html.startswith("<pre>HydroData") and "data:image/png" in html


def test_the_wamit_form_of_a_hams_run_is_read_with_its_control_file(tmp_path):
    """Three frequencies as wave numbers in 20 m of water: too few for Kramers-Kronig to tell."""
    data = samples.body_data(nw=3, depth=20.0)
    folder = samples.hams(data, tmp_path, kind=2)
    got = rss.read_hydro(folder / "Output" / "Wamit_format" / "body.1", rho=data.rho, g=data.g)
    np.testing.assert_allclose(got.omega, data.omega, rtol=1e-9)
    assert got.depth == 20.0 and got.reference_point == data.reference_point


def test_second_order_forces_of_a_wamit_out_are_left_out_and_generalised_modes_refused(tmp_path):
    data = samples.body_data()
    out = samples.wamit_out(data, tmp_path)
    want = rss.read_hydro(out, rho=data.rho)
    second = """
 2nd-order period = infinite                            Wavenumber = zero
 DIFFERENCE-FREQUENCY EXCITING FORCES AND MOMENTS-DIRECT METHOD
  Heading indices:     1    1  Headings (deg):        0.0       0.0
     1   4.011316E-01              0
"""
    text = out.read_text()
    out.write_text(text + second)
    got = rss.read_hydro(out, rho=data.rho)
    assert np.array_equal(got.X, want.X) and any("second-order" in note for note in got.notes)
    seven = re.sub(r"(?m)^(\s+)6(\s+)6( .*)$", r"\g<0>\n\g<1>7\g<2>7\g<3>", text)
    out.write_text(re.sub(r"(?m)^ 6 (\S+ -?\d+)$", r"\g<0>\n 7 \g<1>", seven))
    with pytest.raises(rss.InputError, match="generalised modes"):
        rss.read_hydro(out, rho=data.rho)


def wave_column(path, tmp_path, to):
    """Write a WAMIT run again with another first column."""
    for suffix in (".1", ".3"):
        rows = [line.split(maxsplit=1) for line in path.with_suffix(suffix).read_text().splitlines()]
        rows = [r for r in rows if r[0][0].isdigit() and float(r[0]) > 0.0]
        (tmp_path / f"again{suffix}").write_text("\n".join(f"{to(float(a)):.9e} {b}" for a, b in rows) + "\n")
    return tmp_path / "again.1"


def test_hams_first_column_is_recognised_and_said(data, caplog):
    path = data / "bem" / "formats" / "raft_cylinder.1"
    got = rss.read_hydro(path, rho=1025.0)
    np.testing.assert_allclose(got.omega, np.linspace(0.2, 6.0, 30), rtol=1e-12)
    assert "taken as omega" in caplog.text and any("taken as omega" in note for note in got.notes)
    assert np.array_equal(rss.read_hydro(path, rho=1025.0, first_column="omega").B, got.B)
    as_period = rss.read_hydro(path, rho=1025.0, first_column="period")
    assert as_period.omega[-1] == pytest.approx(2.0 * np.pi / 0.2)
    assert "Kramers-Kronig" not in {f.kind for f in got.check().problems}
    assert "Kramers-Kronig" in {f.kind for f in as_period.check().problems}


@pytest.mark.parametrize("reading, to", [
    ("omega", lambda T: 2.0 * np.pi / T), ("wavelength", lambda T: 9.81 * T ** 2 / (2.0 * np.pi)),
    ("wavenumber", lambda T: (2.0 * np.pi / T) ** 2 / 9.81)])
def test_each_reading_of_a_wamit_run_is_told_from_a_period(data, tmp_path, reading, to):
    path = data / "bem" / "formats" / "sphere.1"
    want = rss.read_hydro(path, rho=1000.0, depth=50.0)
    got = rss.read_hydro(wave_column(path, tmp_path, to), rho=1000.0, g=9.81)
    assert any(f"taken as {reading}:" in note for note in got.notes)
    np.testing.assert_allclose(got.omega, want.omega, rtol=1e-6)
    np.testing.assert_allclose(got.B, want.B, rtol=1e-5, atol=1e-6 * np.abs(want.B).max())


@pytest.mark.parametrize("column, at_zero, at_negative, exchanged", [
    ("omega", 5.0, 2.0, False), ("omega", 2.0, 5.0, True), ("omega", None, 5.0, True), ("omega", 3.6, 3.4, False),
    ("omega", 3.4, 3.6, False), ("wavenumber", 2.0, 5.0, True), ("period", 2.0, 5.0, False),
    ("period", 5.0, 2.0, False)])
def test_limits_marked_as_those_of_periods_are_told_by_their_added_mass(tmp_path, caplog, column, at_zero, at_negative,
                                                                        exchanged):
    """Added mass falls from 5 at omega = 0 to 2; a limit in between says nothing, and WAMIT's own periods are kept."""
    omega = np.linspace(0.1, 6.0, 12)
    first = {"omega": omega, "wavenumber": omega**2 / 9.81, "period": 2.0 * np.pi / omega}[column]
    rows = [f"{c:.9e} 3 3 {2.0 + 3.0 / (1.0 + w**2):.9e} 0.1\n" for c, w in zip(first, omega)]
    limits = [f"{mark} 3 3 {a}\n" for mark, a in ((0.0, at_zero), (-1.0, at_negative)) if a is not None]
    (tmp_path / "body.1").write_text("".join(limits + rows))
    got = rss.read_hydro(tmp_path / "body.1", rho=1000.0, g=9.81, first_column=column)
    np.testing.assert_allclose(got.omega, omega, rtol=1e-8)
    zero_is_infinite = exchanged != (column == "period")
    inf, zero = (at_zero, at_negative) if zero_is_infinite else (at_negative, at_zero)
    for found, value in ((got.A_inf, inf), (got.A_zero, zero)):
        assert found is None if value is None else found[0, 0] == pytest.approx(1000.0 * value)
    assert exchanged == any("rule for periods" in note for note in got.notes) == ("rule for periods" in caplog.text)


@pytest.mark.parametrize("name", ["sphere.1", "iea15/UMaineSemi.1"])
def test_periods_stay_periods(data, name):
    assert not any("taken as" in note for note in rss.read_hydro(data / "bem" / "formats" / name, rho=1025.0).notes)


def test_aqwa_file_of_two_structures(data):
    """WEC-Sim's RM3: the numbers of the text itself, and the damping of the float in heave by another program."""
    text = gzip.decompress((data / "bem" / "formats" / "rm3_two_bodies.AH1.gz").read_bytes()).decode()
    got = rss.read_hydro(data / "bem" / "formats" / "rm3_two_bodies.AH1.gz")
    assert got.n == 12 and got.dofs[8] == "body2__Heave" and got.depth == 49.5
    lines = text[text.index("\nADDEDMASS\n"):].splitlines()
    first = next(k for k, line in enumerate(lines) if line.split()[:3] == ["1", "2", "7"])
    assert got.A[6, 0, 6:].tolist() == [float(v) for v in lines[first].split()[3:]]
    assert got.M[2, 2] == 7.2647e5 and got.M[8, 8] == 8.9004e5 and not got.M[:6, 6:].any()
    other = rss.read_hydro(data / "bem" / "formats" / "rm3_capytaine.nc")
    band = (got.omega > 0.9) & (got.omega < 1.8)  # another depth matters below
    want = np.interp(got.omega, other.omega, other.B[:, 2, 2])
    assert np.abs(got.B[:, 2, 2] - want)[band].max() < 0.03 * want.max()


def lines_without(path, word):
    text = path.read_text().splitlines(keepends=True)
    k = next(k for k, line in enumerate(text) if word in line and not line.startswith("*"))
    return "".join(text[:k] + text[k + 1:])


@pytest.mark.parametrize("name, word", [("sphere.out", "ADDED-MASS AND DAMPING"), ("sphere.out", "DIFFRACTION EX"),
                                        ("sphere.out", "Wave Heading"), ("sphere.out", "Wave period (sec)"),
                                        ("sphere.out", "XBODY"), ("sphere.out", "C(4,4)"), ("sphere.AH1", "DAMPING"),
                                        ("sphere.AH1", "FORCERAO"), ("sphere.AH1", "HYDSTIFFNESS"),
                                        ("sphere.AH1", "COG")])
def test_a_lost_heading_is_noticed(data, tmp_path, name, word):
    (tmp_path / name).write_text(lines_without(data / "bem" / "formats" / name, word))
    with pytest.raises(rss.InputError, match=name):
        rss.read_hydro(tmp_path / name, rho=1000.0 if name.endswith("out") else None)


def test_wamit_files_cut_short_are_refused(data, tmp_path):
    folder = data / "bem" / "formats"
    for suffix in (".1", ".3", ".hst"):
        (tmp_path / f"sphere{suffix}").write_bytes((folder / f"sphere{suffix}").read_bytes())
    stiffness = (tmp_path / "sphere.hst").read_text().splitlines()
    (tmp_path / "sphere.hst").write_text("\n".join(stiffness[:-1]) + "\n")
    with pytest.raises(rss.InputError, match=r"sphere\.hst: 35 entries"):
        rss.read_hydro(tmp_path / "sphere.1", rho=1000.0)
    (tmp_path / "sphere.hst").write_text("\n".join(stiffness) + "\n")
    rows = (tmp_path / "sphere.1").read_text().splitlines(keepends=True)
    upper = [row for k, row in enumerate(rows) if k == 0 or int(row.split()[1]) <= int(row.split()[2])]
    (tmp_path / "sphere.1").write_text("".join(upper))
    with pytest.raises(rss.InputError, match="both triangles"):
        rss.read_hydro(tmp_path / "sphere.1", rho=1000.0)
    last = rows[-1].split()[0]
    (tmp_path / "sphere.1").write_text("".join(row for row in rows if row.split()[0] != last))
    with pytest.raises(rss.InputError, match="not the same ones"):
        rss.read_hydro(tmp_path / "sphere.1", rho=1000.0)
    out = (folder / "sphere.out").read_text().splitlines()
    k = next(k for k, line in enumerate(out) if "DAMPING COEFFICIENTS" in line) + 4
    out[k] = " ".join(out[k].split()[:3])
    (tmp_path / "sphere.out").write_text("\n".join(out))
    with pytest.raises(rss.InputError, match=rf"sphere\.out, line {k + 1}: 3 columns found, 4 needed"):
        rss.read_hydro(tmp_path / "sphere.out", rho=1000.0)
    out = (folder / "sphere.out").read_text().splitlines()
    starts = [k for k, line in enumerate(out) if "Wave period" in line]
    (tmp_path / "sphere.out").write_text("\n".join(out[:starts[-2]]) + "\n")  # whole periods, two of them lost
    with pytest.raises(rss.InputError, match=rf"lists {len(starts)} periods, {len(starts) - 2} are there"):
        rss.read_hydro(tmp_path / "sphere.out", rho=1000.0)


def test_older_aqwa_file_begins_with_the_number_of_structures(tmp_path):
    """As FOSWEC's file of 2015 (WEC-Sim/bemio): no version, one head, depth, density and gravity once."""
    data = samples.body_data(("one", "two"))
    path = samples.aqwa(data, tmp_path, ((0.0, 0.0, -2.0), (1.0, 0.5, -1.0)))
    new = rss.read_hydro(path)
    lines = path.read_text().splitlines()
    heads = [k for k, line in enumerate(lines) if re.match(r" [12] \d+ \d+ ", line)][:2]
    at = lines.index("GENERAL")
    first = [f" 2{lines[heads[0]][2:]}", *lines[heads[0] + 1:heads[1]]]
    general = f" {data.depth:.3f} {data.rho:.3f} {data.g:.5f} 1"
    path.write_text("\n".join(["* DATE:14/04/15", *first, "GENERAL", general, *lines[at + 3:]]) + "\n")
    old = rss.read_hydro(path)
    for name in ("omega", "A", "B", "X", "C", "M", "directions"):
        np.testing.assert_array_equal(getattr(old, name), getattr(new, name))
    path.write_text(path.read_text().replace(first[0], " 3" + first[0][2:]))
    with pytest.raises(rss.InputError, match="COG is cut off"):
        rss.read_hydro(path)


def test_a_table_of_interior_tanks_is_no_stiffness(tmp_path):
    """WAMIT's test 22: the columns of the tanks' table have the names of the restoring coefficients."""
    data = plain_body(reference_point=(0.0, 0.0, -2.0))
    path = samples.wamit_out(data, tmp_path)
    whole = rss.read_hydro(path)
    table = " Tank parameters:\n   NTANK ZTANKFS VOLX VOLY VOLZ\n 1 1.0 9.2 9.2 9.2\n RHOTANK -C(3,3) C(3,4) C(3,5)\n"
    head, line, rest = path.read_text().partition(" Wave period")
    path.write_text(f"{head}{table} 1 1.0 8.4 0.0 8.4\n\n{line}{rest}")
    got = rss.read_hydro(path)
    assert_close(got, whole, ("A", "B", "C", "X"))
    assert any("interior tanks" in note for note in got.notes)


def test_a_heeled_datum_of_orcaflex_is_refused(tmp_path):
    path = samples.orcaflex(plain_body(), tmp_path)
    path.write_text(path.read_text().replace("DatumPosition: [-2, 0, 0]", "DatumPosition: [-2, 5, 0]"))
    with pytest.raises(rss.InputError, match="heel 5 and trim 0"):
        rss.read_hydro(path)


def test_a_stiffness_that_repeats_is_read_and_one_that_contradicts_is_refused(data, tmp_path):
    """WindCrete's and TripleSpar's public .hst end with their last row twice."""
    folder = data / "bem" / "formats"
    for suffix in (".1", ".hst"):
        (tmp_path / f"sphere{suffix}").write_bytes((folder / f"sphere{suffix}").read_bytes())
    stiffness = tmp_path / "sphere.hst"
    stiffness.write_text(stiffness.read_text() + "    6    6    0.000000E+00\n")
    got = rss.read_hydro(tmp_path / "sphere.1", rho=1000.0)
    assert any("there twice, with the same stiffness" in note for note in got.notes)
    stiffness.write_text(stiffness.read_text() + "    3    3    0.100000E+00\n")
    with pytest.raises(rss.InputError, match=r"sphere\.hst, line 39: modes 3, 3 are there twice, with different"):
        rss.read_hydro(tmp_path / "sphere.1", rho=1000.0)


def test_impulse_responses_of_f2t_are_no_coefficients(tmp_path):
    times, pairs = np.arange(0.0, 2.0, 0.1), [(i, i) for i in range(1, 7)]
    response = np.sin(3.0 * times) * np.exp(-times)
    (tmp_path / "buoy_IR.1").write_text("".join(f"{t:.4f} {i} {j} {value:.5e} {value:.5e}\n"
                                                for t, value in zip(times, response) for i, j in pairs))
    with pytest.raises(rss.InputError, match=r"buoy_IR\.1: .* steps of 0\.1: impulse responses"):
        rss.read_hydro(tmp_path / "buoy_IR.1", rho=1000.0)


def test_an_added_mass_at_infinity_of_zeros_is_taken_as_absent(tmp_path):
    data = samples.body_data(A_inf=np.zeros((6, 6)))
    got = rss.read_hydro(samples.wamit(data, tmp_path), rho=1025.0, length=2.0)
    assert got.A_inf is None and any("taken as absent" in note for note in got.notes)
    assert_close(got, data, ("omega", "A"))


def test_bemio_flags_may_be_booleans(tmp_path):
    import h5py

    data = samples.body_data()
    path = samples.bemio(data, tmp_path)
    with h5py.File(path, "a") as file:
        del file["simulation_parameters/scaled"]
        file["simulation_parameters/scaled"] = np.False_
    assert_close(rss.read_hydro(path), data, ("omega", "A", "B", "C", "X"))


def test_nemohs_phases_in_an_old_bemio_file_are_converted_and_said(data, tmp_path):
    """Python BEMIO 1.1 left NEMOH's exp(-i w t); the run's own folder has the other sign."""
    import h5py

    sound = rss.read_hydro(data / "bem" / "formats" / "sphere.out", rho=1000.0)
    path = samples.bemio(sound, tmp_path)
    with h5py.File(path, "a") as file:
        del file["bem_data/code"]
        file["bem_data/code"] = "NEMOH"
        file["body1/hydro_coeffs/excitation/im"][...] *= -1.0
    got = rss.read_hydro(path)
    np.testing.assert_allclose(got.X, sound.X, rtol=1e-12)
    assert any("exp(-i w t)" in note for note in got.notes)


def test_bemio_centre_of_gravity_of_wrong_size(tmp_path):
    import h5py

    path = samples.bemio(samples.body_data(), tmp_path)
    with h5py.File(path, "a") as file:
        del file["body1/properties/cg"]
        file["body1/properties/cg"] = np.zeros((3, 2))
    with pytest.raises(rss.InputError, match=r"properties/cg has 6 values; a point"):
        rss.read_hydro(path)


@pytest.mark.parametrize("compressed", [True, False])
def test_matlab_files_hold_what_scipy_reads(tmp_path, compressed):
    from scipy.io import loadmat, savemat

    cells = np.empty((1, 3), dtype=object)
    cells[0] = [np.arange(6.0).reshape(2, 3), "word", np.array([[1 + 2j, 3.0]])]
    content = {"vessel": {"A": np.random.default_rng(0).normal(size=(6, 6, 3, 2)), "name": "ship", "n": np.int16(7),
                          "main": {"rho": 1025.0, "empty": np.zeros((0, 0))}, "cells": cells}}
    savemat(tmp_path / "x.mat", content, do_compression=compressed)
    got = read_mat(tmp_path / "x.mat")["vessel"]
    want = loadmat(tmp_path / "x.mat", simplify_cells=True)["vessel"]
    np.testing.assert_array_equal(got["A"], want["A"])
    assert got["name"] == "ship" and got["n"].item() == 7 and got["main"]["rho"].item() == 1025.0
    assert got["main"]["empty"].size == 0 and got["cells"][1] == "word"
    np.testing.assert_array_equal(got["cells"][0], want["cells"][0])
    np.testing.assert_array_equal(got["cells"][2].ravel(), want["cells"][2])


def test_a_damaged_number_in_our_own_file_is_not_read_as_another(tmp_path):
    """The file carries checksums: a byte that is changed within the numbers is refused."""
    data = samples.body_data()
    rss.write_hydro(data, tmp_path / "x.nc")
    whole = (tmp_path / "x.nc").read_bytes()
    for row in (data.A[2, 3], data.B[1, 0], data.A_inf[5]):
        at = whole.index(row.tobytes()) + 13
        (tmp_path / "x.nc").write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1:])
        with pytest.raises(rss.InputError, match=r"x\.nc: not a readable netCDF dataset"):
            rss.read_hydro(tmp_path / "x.nc")


def test_messages_have_a_limited_length(tmp_path):
    data = samples.body_data()
    path = samples.wamit(data, tmp_path)
    path.write_text(path.read_text() + " 1.0 1 1 " + "9" * 300_000 + "x 0.0\n")
    with pytest.raises(rss.InputError, match=r"body\.1, line") as caught:
        rss.read_hydro(path)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("names", [("",), ("float", "spar")])
def test_stiffness_by_entries_as_meccs_files_have_it(names):
    data = samples.body_data(names)
    dataset = data.to_xarray()
    blocks = [data.C[6 * k + 2:6 * k + 5, 6 * k + 2:6 * k + 5] for k in range(len(names))]
    upper = np.array([0.5 * (block + block.T)[np.triu_indices(3)] for block in blocks])
    labels = ["S33", "S34", "S35", "S44", "S45", "S55"]
    entries = (("bodies", "hydrostatic_S"), upper) if names[0] else (("hydrostatic_S",), upper[0])
    dataset = dataset.drop_vars("hydrostatic_stiffness").assign(hydrostatic_stiffness=entries)
    got = rss.read_hydro(dataset.assign_coords(hydrostatic_S=labels))
    for k, block in enumerate(blocks):
        np.testing.assert_allclose(got.C[6 * k + 2:6 * k + 5, 6 * k + 2:6 * k + 5], 0.5 * (block + block.T))
    assert np.count_nonzero(got.C) == 9 * len(names)
    with pytest.raises(rss.InputError, match="S33"):
        rss.read_hydro(dataset.assign_coords(hydrostatic_S=["S11", *labels[1:]]))


def wamit_run(folder, forces):
    """One body with two modes, added mass and damping at two periods, and rows of exciting force."""
    (folder / "body.1").write_text("".join(f"{period} {i} {j} {1.0 + (i == j)} {0.1 * (i == j)}\n"
                                           for period in (3.0, 4.0) for i in (3, 5) for j in (3, 5)))
    (folder / "body.3").write_text("".join(f"{period} 0.0 {row}\n" for period in (3.0, 4.0) for row in forces))
    return rss.read_hydro(folder / "body.1", rho=1000.0)


def test_exciting_forces_that_a_wamit_file_lacks_or_tells_in_two_ways_are_refused(tmp_path):
    heave, pitch = "3 2.0 90.0 0.0 2.0", "5 1.0 180.0 -1.0 0.0"
    X = wamit_run(tmp_path, (heave, pitch)).X
    assert np.allclose(X[:, 0] / X[:, 0, :1], [1.0, 0.5j])
    with pytest.raises(rss.InputError, match="no exciting force of mode 5, whose added mass is there"):
        wamit_run(tmp_path, (heave,))
    with pytest.raises(rss.InputError, match="line 2: real and imaginary part"):
        wamit_run(tmp_path, (heave, "5 1.0 180.0 1.0 0.0"))


def test_forces_that_are_rounding_noise_may_be_told_in_two_ways(tmp_path):
    """WAMIT prints 90 deg for what symmetry makes zero; forces and moments are each measured by their largest."""
    heave = "3 2.0 90.0 0.0 2.0"
    X = wamit_run(tmp_path, (heave, "5 1.0E-20 -90.0 1.0E-20 -1.0E-30", "4 1.0E-3 0.0 1.0E-3 0.0")).X
    assert np.abs(X[:, 0, 1]).max() <= 1e-19 * np.abs(X[:, 0, 0]).max()
    for pitch, largest in (("5 1.0E-5 -90.0 1.0E-5 0.0", "4 1.0 0.0 1.0 0.0"),
                           ("5 1.0E-20 -90.0 1.0E-20 0.0", "4 0.0 0.0 0.0 0.0")):
        with pytest.raises(rss.InputError, match=r"body\.3, line 2: real and imaginary part, 1e-.*phase -90 deg"):
            wamit_run(tmp_path, (heave, pitch, largest))


def test_a_wamit_out_without_the_force_of_a_mode_or_with_turned_axes_is_refused(tmp_path):
    path = samples.wamit_out(samples.body_data(), tmp_path)
    whole = path.read_text()
    path.write_text(re.sub(r"(?m)^ 5 \S+ -?\d+\n", "", whole))
    with pytest.raises(rss.InputError, match="no exciting force of mode 5, whose added mass is there"):
        rss.read_hydro(path)
    path.write_text(whole.replace("PHIBODY =   0.0", "PHIBODY =  90.0"))
    with pytest.raises(rss.InputError, match="line 3: PHIBODY = 90 deg"):
        rss.read_hydro(path)


def test_files_of_a_nemoh_run_that_are_not_read_are_noted(tmp_path):
    folder = samples.nemoh(samples.body_data(A_inf=None), tmp_path / "run")
    assert not any("is not read" in note for note in rss.read_hydro(folder).notes)
    for name in ("Km.dat", "Badd.dat"):
        (folder / name).write_text("1 0 0 0 0 0\n")
    notes = rss.read_hydro(folder).notes
    assert all(any(f"{name} is not read" in note for note in notes) for name in ("Km.dat", "Badd.dat"))


def test_aqwas_general_row_of_six_columns_needs_no_comment_in_the_head(tmp_path):
    data = samples.body_data()
    path = samples.aqwa(data, tmp_path)
    path.write_text("".join(line for line in path.read_text().splitlines(keepends=True) if "LHFR" not in line))
    assert_close(rss.read_hydro(path), data, ("omega", "A", "B", "X"))


def test_a_hydrostar_file_in_tonnes_is_refused(tmp_path):
    samples.hydrostar(samples.body_data(), tmp_path)
    path = tmp_path / "AddedMass_33.rao"
    path.write_text(path.read_text().replace("#COMPONENT", "#UNIT       :  t\n#COMPONENT"))
    with pytest.raises(rss.InputError, match=r"AddedMass_33.rao: unit t; kg, N, m and s are read"):
        rss.read_hydro(tmp_path)


@pytest.mark.parametrize("write", [samples.aqwa, samples.aqwa_lis])
@pytest.mark.parametrize("changes, words", [
    ({"rho": 1.025}, r"rho: 1.025 kg/m\^3 found, some 1000 needed; it looks like t/m\^3, and the rest"),
    ({"rho": 1.9905}, r"looks like slug/ft\^3"), ({"g": 32.174}, r"g: 32.174 m/s\^2 found.*looks like ft/s\^2")])
def test_files_in_other_units_than_si_are_told_by_density_and_gravity(tmp_path, write, changes, words):
    with pytest.raises(rss.InputError, match=words):
        rss.read_hydro(write(plain_body(**changes), tmp_path))


def test_a_density_given_in_tonnes_is_refused(tmp_path):
    path = samples.wamit(plain_body(), tmp_path)
    assert rss.read_hydro(path, rho=998.2).rho == 998.2
    with pytest.raises(rss.InputError, match=r"body.1: rho: 1.025 kg/m\^3 found"):
        rss.read_hydro(path, rho=1.025)


def test_an_openfast_file_names_its_bodies_in_their_order(tmp_path):
    a, b = np.kron(np.eye(2), [[0.0, 1.0], [-4.0, -1.0]]), np.kron(np.eye(2), [[0.0], [1.0]])
    pair = rss.RadiationFit(("beta__Heave", "alpha__Heave"), a, b, np.kron(np.eye(2), [[0.0, 2.0]]), 2)
    first = pair.write(tmp_path / "pair.ss").read_text().splitlines()[0]
    assert first.endswith("bodies in this order: beta, alpha")


def test_forces_of_a_hams_run_under_another_name_are_noted(tmp_path):
    folder = samples.hams(samples.body_data(), tmp_path)
    output = folder / "Output" / "Wamit_format"
    (force,) = output.glob("*.3")
    force.rename(output / "ExcForce.3")
    data = rss.read_hydro(folder)
    assert data.X is None and any("ExcForce.3 is not read" in note for note in data.notes)


def test_modes_of_a_wamit_run_without_added_mass_are_noted(tmp_path):
    """Added mass of five modes, forces and stiffness of six."""
    data = samples.body_data()
    path = samples.wamit(data, tmp_path)
    rows = [line for line in path.read_text().splitlines() if "6" not in line.split()[1:3]]
    path.write_text("\n".join(rows) + "\n")
    found = rss.read_hydro(path, rho=data.rho, g=data.g, depth=data.depth, length=2.0)
    assert found.dofs == data.dofs[:5] and np.allclose(found.X, data.X[:, :, :5])
    assert any("body.1: exciting forces of mode 6 (Yaw) left out: the run has no added mass" in n for n in found.notes)
    hst = tmp_path / "body.hst"
    assert not any("stiffness of mode" in note for note in found.notes)
    hst.write_text(hst.read_text().replace(" 6 6 0.0000000000e+00", " 6 6 2.0"))
    found = rss.read_hydro(path, rho=data.rho, g=data.g, depth=data.depth, length=2.0)
    assert any("stiffness of mode 6 (Yaw) left out" in note for note in found.notes)


@pytest.mark.parametrize(("lead", "share", "said"), [
    (1j, 1.0, None), (-1j, 1.0, "lags"), (1j, 0.4, "no waves long enough to tell"),
    (-1j, 0.4, "no waves long enough to tell"), (1.0, 1.0, "no waves long enough to tell")])
def test_a_hams_run_whose_time_factor_the_band_does_not_tell_says_so(tmp_path, lead, share, said):
    """Heave's force is `share` of its stiffness and surge's leads by a quarter period where waves are long."""
    data = samples.body_data(nw=3)
    C, X = np.zeros((6, 6)), np.zeros_like(data.X)
    C[2, 2], X[:, :, 2], X[:, :, 0] = 1e4, share * 1e4, lead * 1e3 * data.omega[:, None] ** 2
    notes = rss.read_hydro(samples.hams(data.replace(C=C, X=X), tmp_path)).notes
    told = [note for note in notes if "lags" in note or "no waves long enough" in note]
    assert len(told) == (said is not None) and all(said in note for note in told)
