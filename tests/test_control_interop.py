"""Every public system through python-control as a user would take it, with python-control's warnings as errors."""

import logging
import pickle
import warnings

import control as ct
import numpy as np
import pytest
from matplotlib import pyplot as plt
from plant_bodies import coupled_fit, coupled_model, tank_fit, tank_model

import radiation_ss as rss
from radiation_ss.simulation import linear_response

OMEGA = np.geomspace(0.2, 50.0, 60)


def systems():
    """Return every kind of system that the package hands out."""
    pair = coupled_model(("Sway", "Roll"), 2)
    return {"radiation": tank_fit().to_ss(), "radiation 2x2": coupled_fit(("Sway", "Roll")).to_ss(),
            "body": rss.rigid_body(pair), "heave": rss.cummins(tank_model()), "pair": rss.cummins(pair),
            "moored": rss.cummins(pair, stiffness={"Sway": 2e5}, damping={"Roll": 1e5}),
            "zoh": rss.sampled(tank_model(), 0.02, "zoh").to_ss(), "foh": rss.sampled(tank_fit(), 0.02).to_ss(),
            "tustin": rss.sampled(pair, 0.05, "tustin").to_ss()}


ALL = list(systems())


@pytest.fixture(params=ALL)
def system(request):
    yield systems()[request.param]
    plt.close("all")


def test_is_native_with_clean_names(system):
    assert type(system) is ct.StateSpace
    for labels in (system.input_labels, system.output_labels, system.state_labels):
        assert len(set(labels)) == len(labels) and not any("." in label for label in labels)


def test_bode_and_nyquist(system):
    omega = OMEGA if system.isctime() else OMEGA[OMEGA < 0.9 * np.pi / system.dt]
    plots = ct.bode_plot(system[:2, 0], omega)
    assert isinstance(plots, ct.ControlPlot)
    plt.close("all")
    counts = ct.nyquist_response(system[0, 0], omega, warn_encirclements=False, warn_nyquist=False)
    assert isinstance(ct.nyquist_plot(counts), ct.ControlPlot)


def test_responses_in_time(system):
    step = ct.step_response(system, 5.0)
    assert isinstance(step, ct.TimeResponseData) and np.isfinite(step.outputs).all()
    t = np.linspace(0.0, 5.0, 101) if system.isctime() else system.dt * np.arange(100)
    u = np.sin(np.outer(np.arange(1, system.ninputs + 1), t))
    forced = ct.forced_response(system, t, u)
    assert forced.output_labels == system.output_labels


def test_a_users_own_block_connects_by_name():
    model = tank_model()
    buoy = rss.cummins(model)
    damper = ct.ss([], [], [], [[-40.0]], inputs=["heave_vel"], outputs=["pto"], name="damper")
    total = ct.summing_junction(["wave", "pto"], "heave_force")
    joined = ct.interconnect([buoy, damper, total], inputs=["wave"], outputs=buoy.output_labels)
    ours = rss.cummins(model, damping={"Heave": 40.0})
    assert ct.frequency_response(joined, OMEGA).frdata == pytest.approx(
        ct.frequency_response(ours, OMEGA).frdata, rel=1e-9)


def test_a_damper_between_two_bodies():
    model = coupled_model(("float__Heave", "spar__Heave"), 5)
    c = 3e5
    between = rss.cummins(model, damping=[[c, -c], [-c, c]])
    take_off = ct.ss([], [], [], [[-c, c], [c, -c]], inputs=["float_heave_vel", "spar_heave_vel"],
                     outputs=["on_float", "on_spar"], name="take_off")
    sums = [ct.summing_junction([f"wave_{b}", f"on_{b}"], f"{b}_heave_force", name=f"sum_{b}")
            for b in ("float", "spar")]
    plant = rss.cummins(model)
    joined = ct.interconnect([plant, take_off, *sums], inputs=["wave_float", "wave_spar"], outputs=plant.output_labels)
    assert ct.frequency_response(joined, OMEGA).frdata == pytest.approx(ct.frequency_response(between, OMEGA).frdata,
                                                                        rel=1e-8)


def test_feedback_of_body_and_memory_is_the_composite():
    model = tank_model()
    body = rss.rigid_body(model)
    loop = ct.feedback(body["heave_vel", "heave_force"], model.fit.to_ss())
    assert ct.frequency_response(loop, OMEGA).frdata[0, 0] == pytest.approx(
        ct.frequency_response(rss.cummins(model), OMEGA).frdata[1, 0], rel=1e-9)
    nonlinear = ct.nlsys(None, lambda t, x, u, params: -5.0 * u * np.abs(u), inputs=["heave_vel"],
                         outputs=["drag"], name="drag")
    total = ct.summing_junction(["wave", "drag"], "heave_force")
    plant = rss.cummins(model)
    joined = ct.interconnect([plant, nonlinear, total], inputs=["wave"], outputs=plant.output_labels)
    t = np.linspace(0.0, 3.0, 301)
    assert np.isfinite(ct.input_output_response(joined, t, np.sin(6.0 * t)).outputs).all()


def test_lqr_and_lqe_on_the_composite():
    model = tank_model()
    plant = rss.cummins(model)
    Q = np.diag([0.0] * model.fit.states + [1e4, 1e2])
    K, _, poles = ct.lqr(plant, Q, [[1e-3]])
    assert poles.real.max() < np.linalg.eigvals(plant.A).real.max() < 0.0
    L, _, poles = ct.lqe(plant.A, plant.B, plant.C[:1], [[1.0]], [[1e-8]])
    assert poles.real.max() < 0.0
    controller = ct.ss(plant.A - plant.B @ K - L @ plant.C[:1], L, K, 0, inputs=["heave"], outputs=["heave_force"])
    loop = ct.feedback(plant[0, 0], controller)
    assert loop.poles().real.max() < 0.0
    assert 0.0 < rss.robust_margin(plant[0, 0], controller, input_scale=model.C[0, 0]) < 1.0


def test_discrete_lqr_and_lqe():
    plant = rss.sampled(tank_model(), 0.02, "zoh").to_ss()
    K, _, poles = ct.dlqr(plant, np.eye(plant.nstates), [[1.0]])
    assert K.shape == (1, plant.nstates) and np.abs(poles).max() < 1.0
    _, _, poles = ct.dlqe(plant.A, plant.B, plant.C[:1], [[1.0]], [[1e-6]])
    assert np.abs(poles).max() < 1.0


@pytest.mark.parametrize("method", ["zoh", "bilinear", "foh"])
def test_sample_system_takes_the_composite(method):
    sampled = ct.sample_system(rss.cummins(coupled_model()), 0.05, method=method)
    assert np.abs(sampled.poles()).max() < 1.0


@pytest.mark.parametrize("method", ["truncate", "matchdc"])
def test_modal_reduction(method):
    # This memory is modal already, a pair of states for each mode: dropping a pair drops exactly its poles.
    system = coupled_fit(("Sway", "Roll"), pairs=3).to_ss()
    reduced = ct.model_reduction(system, elim_states=[10, 11], method=method)
    kept = np.linalg.eigvals(system.A[:10, :10])
    assert np.sort_complex(reduced.poles()) == pytest.approx(np.sort_complex(kept))


def test_algebra_keeps_working():
    plant = rss.cummins(tank_model())
    fit = tank_fit()
    assert (fit.to_ss() + fit.to_ss())(1j)[()] == pytest.approx(2.0 * fit.frequency_response(1.0)[0, 0, 0])
    assert ct.append(plant, fit.to_ss()).ninputs == 2
    assert (-plant).ninputs == 1
    assert plant["heave_vel", "heave_force"].noutputs == 1
    assert ct.tf(fit.to_ss()).num[0][0].size <= 4


def test_frequency_data_and_records():
    data = rss.HydroData(OMEGA, np.ones((60, 1, 1)), np.ones((60, 1, 1)), A_inf=[[0.5]], dofs=("Heave",))
    measured = data.to_frd()
    assert type(measured) is ct.FrequencyResponseData
    assert isinstance(ct.bode_plot(measured), ct.ControlPlot)
    plt.close("all")
    t = np.linspace(0.0, 5.0, 101)
    response = linear_response(tank_model(), t, np.sin(t))
    assert type(response) is ct.TimeResponseData
    assert isinstance(response.plot(), ct.ControlPlot)
    assert {"time", "heave", "heave_vel", "heave_acc"} <= set(response.to_pandas().columns) | {"time"}
    plt.close("all")


@pytest.mark.parametrize("record", [tank_fit(), tank_model(), rss.sampled(tank_fit(), 0.1), rss.jonswap(1.0, 8.0),
                                    rss.realise(rss.jonswap(1.0, 8.0), 60.0, 0.5)], ids=lambda r: type(r).__name__)
def test_records_pickle(record):
    again = pickle.loads(pickle.dumps(record))
    assert type(again) is type(record)
    if hasattr(record, "to_ss"):
        assert np.array_equal(again.to_ss().A, record.to_ss().A)


@pytest.mark.parametrize("name", ["sphere_capytaine.nc", "cylinder_capytaine.nc"])
def test_capytaine_file_to_lqr(data, name):
    """Issue 2, item 4: a Capytaine file: fit, Bode and Nyquist, LQR on the composite."""
    hydro = rss.read_hydro(data / "bem" / "formats" / name)
    heave = hydro.select([d for d in hydro.dofs if d.endswith("Heave")][:1])
    if heave.A_inf is None:
        heave = heave.with_A_inf()
    fit = rss.fit_radiation(heave, 4)
    assert fit.stable and fit.passive and fit.relative_error < 0.1
    if heave.M is None or heave.C is None:
        heave = heave.replace(M=heave.A_inf, C=[[1e5]])
    plant = rss.cummins(heave, fit)
    assert isinstance(ct.bode_plot(plant, OMEGA), ct.ControlPlot)
    assert isinstance(ct.nyquist_plot(ct.nyquist_response(plant[0, 0], OMEGA)), ct.ControlPlot)
    plt.close("all")
    Q = np.diag([0.0] * fit.states + [1e6, 1e6])
    _, _, poles = ct.lqr(plant, Q, [[1e-6]])
    assert poles.real.max() < 0.0


def capytaine_buoy(path):
    """Write the dataset of a half-sphere of radius 1 m that Capytaine solves here, with a lid on its waterplane."""
    cpt = pytest.importorskip("capytaine")
    xr = pytest.importorskip("xarray")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logging.getLogger("capytaine").setLevel("ERROR")  # its own set_logging would silence every library
        mesh = cpt.mesh_sphere(radius=1.0, center=(0, 0, 0), resolution=(10, 12)).immersed_part()
        body = cpt.FloatingBody(mesh=mesh, lid_mesh=mesh.generate_lid(), center_of_mass=(0, 0, -0.3), name="buoy")
        body.add_translation_dof(name="Heave")
        body.inertia_matrix = body.add_dofs_labels_to_matrix([[1000.0 * 2.0 / 3.0 * np.pi]])
        body.hydrostatic_stiffness = body.compute_hydrostatic_stiffness()
        cases = xr.Dataset(coords={"omega": np.concatenate([np.linspace(0.4, 8.0, 20), [np.inf]]),
                                   "radiating_dof": ["Heave"]})
        cpt.export_dataset(str(path), cpt.BEMSolver().fill_dataset(cases, body, hydrostatics=True, progress_bar=False))


def test_capytaine_solved_now_to_lqr(tmp_path):
    """The same from a body that Capytaine solves in the test; added mass against the known half of the displacement."""
    capytaine_buoy(tmp_path / "buoy.nc")
    hydro = rss.read_hydro(tmp_path / "buoy.nc")
    displaced = 1000.0 * 2.0 / 3.0 * np.pi
    assert hydro.A_inf[0, 0] == pytest.approx(0.5 * displaced, rel=0.08)  # a coarse mesh
    assert hydro.C[0, 0] == pytest.approx(1000.0 * 9.81 * np.pi, rel=0.08)
    fit = rss.fit_radiation(hydro, 4, at_zero="zero")
    assert fit.passive and fit.relative_error < 0.1
    plant = rss.cummins(hydro, fit)
    omega = np.geomspace(0.4, 8.0, 40)
    assert isinstance(ct.bode_plot(plant[0, 0], omega), ct.ControlPlot)
    assert isinstance(ct.nyquist_plot(ct.nyquist_response(plant[0, 0], np.geomspace(0.01, 100.0, 200))), ct.ControlPlot)
    plt.close("all")
    _, _, poles = ct.lqr(plant, np.diag([0.0] * fit.states + [1.0, 0.1]), [[(1.0 / hydro.C[0, 0]) ** 2]])
    assert poles.real.max() < 0.0


def test_a_fit_of_frequency_response_data_goes_with_the_data_they_were_made_of():
    data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 40), gyradius=0.4).select("Heave")
    fit = rss.fit_radiation(data.to_frd(), 3)
    assert fit.dofs == ("heave",)
    plant = rss.cummins(data, fit)
    assert plant.output_labels[0] == "heave" and rss.Model.from_hydro(data, fit.renamed(["Heave"])).dofs == ("Heave",)
