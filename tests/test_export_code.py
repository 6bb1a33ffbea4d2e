"""FMI units and C code: what gcc and FMPy make of them, against the package's own answer."""

import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec

import control as ct
import numpy as np
import pytest
from plant_bodies import coupled_model, tank_model
from scipy.linalg import block_diag, expm

import radiation_ss as rss
from radiation_ss.simulation import nonlinear_system, signals_of, state_equations

SIX = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
GCC = shutil.which("gcc")
needs_gcc = pytest.mark.skipif(GCC is None, reason="no gcc")
EFFECTS = [("quadratic_drag", {"coefficient": 150.0}), ("sensor_gain", {"gain": 0.1}),
           ("tank_resonance", {"coupling": 2.0, "frequency": 6.5, "damping_ratio": 0.03})]


class Library:
    """A function of a C file, compiled by gcc; it may import nothing but what sine and square root need."""

    def __init__(self, source, name):
        target = source.with_suffix(".so")
        subprocess.run([GCC, "-O2", "-Wall", "-Werror", "-Wno-unused", "-shared", "-fPIC", str(source), "-lm", "-o",
                        str(target)], check=True)
        undefined = subprocess.run(["nm", "-u", str(target)], check=True, capture_output=True, text=True).stdout
        assert not [word for word in ("malloc", "calloc", "realloc", "free") if f" {word}" in undefined]
        self.library, self.name = ctypes.CDLL(str(target)), name
        sizes = [ctypes.c_longlong() for _ in range(4)]
        getattr(self.library, f"{name}_work")(*map(ctypes.byref, sizes))
        self.work = [max(size.value, 1) for size in sizes]

    def __call__(self, arguments, sizes):
        pointers = ctypes.POINTER(ctypes.c_double)
        given = [np.ascontiguousarray(a, dtype=float).ravel() for a in arguments]
        results = [np.zeros(size) for size in sizes]
        arg, res = ((pointers * n)(*(a.ctypes.data_as(pointers) for a in arrays))
                    for n, arrays in zip(self.work[:2], (given, results)))
        work = (ctypes.c_longlong * self.work[2])(), (ctypes.c_double * self.work[3])()
        assert getattr(self.library, self.name)(arg, res, *work, 0) == 0
        return results


def states_of(source):
    """Return the number of states that the head of a filter says."""
    return int(re.search(r"filter_step: x\[(\d+)\]", source.read_text(encoding="utf-8"))[1])


@needs_gcc
def test_the_plant_in_c_moves_as_simulate_does(tmp_path):
    model, dt = tank_model(), 0.001
    source = rss.write_c(model, tmp_path / "plant.c", EFFECTS, dt=dt)
    states = len(signals_of(model, EFFECTS)[0])
    step, x, found = Library(source, "plant_step"), np.zeros(states), []
    for _ in range(3000):
        x, y = step((0.0, x, 8.0), (states, 3))
        found.append(y)
    time = dt * np.arange(3000)
    expected = rss.simulate(model, (time, np.full(3000, 8.0)), EFFECTS, step=dt).outputs
    assert np.abs(np.array(found).T - expected).max() < 1e-9 * np.abs(expected).max()


@needs_gcc
def test_a_pole_that_is_fast_for_the_step_does_not_make_it_diverge(tmp_path):
    """Against the matrix exponential under a constant force; one Runge-Kutta step of 6 rad grows a thousandfold."""
    fast = rss.RadiationFit(("Heave",), [[-60.0]], [[60.0]], [[40.0]], order=1)
    model, dt = rss.Model(("Heave",), [[5.3]], [[5.8]], [[582.0]], fit=fast), 0.1
    source = rss.write_c(model, tmp_path / "plant.c", dt=dt)
    assert "one call of plant_step every 0.1 s, u constant between" in source.read_text(encoding="utf-8")
    step, x = Library(source, "plant_step"), np.array([0.0, 0.05, 0.0])
    F, G = model.matrices()
    rest = np.linalg.solve(F, G[:, 0] * 8.0)
    for k in range(1, 31):
        x = step((0.0, x, 8.0), (3, 3))[0]
        exact = expm(F * k * dt) @ (np.array([0.0, 0.05, 0.0]) + rest) - rest
        assert np.abs((x - exact)[1:] / (1.0, 7.0)).max() < 5e-4 * 0.05
    with pytest.raises(rss.InputError, match="dt"):
        rss.write_c(model, tmp_path / "plant.c", dt=0.0)


@needs_gcc
def test_the_filter_in_c_is_the_live_filter_at_its_settled_gain(tmp_path):
    """Both on the same samples, one of them lost; the live filter has constant parameters and no gate.

    It steps by Runge-Kutta's method, the other one exactly: 1e-5 of the force here.
    """
    model, dt = tank_model(), 0.02
    time = dt * np.arange(4000)
    rng = np.random.default_rng(3)
    force = 5.0 * np.sin(5.0 * time) + 3.0 * np.sin(7.3 * time + 1.0)
    motion = rss.simulate(model, (time, force), step=0.005).outputs
    levels = {"Heave": 1e-4, "Heave_acceleration": 0.01}
    record = rss.Record(time, {"Heave": motion[0] + 1e-4 * rng.standard_normal(4000),
                               "Heave_acceleration": motion[2] + 0.01 * rng.standard_normal(4000)})
    live = rss.DualEnKF(model, prior=0.0, n_ensemble=4, learn="never", noise=levels, gate=1e6)
    expected = live.run(record)
    source = rss.write_c(live, tmp_path / "filter.c")
    assert "y: Heave, Heave_acceleration" in source.read_text(encoding="utf-8")
    size = states_of(source)
    step, x, found = Library(source, "filter_step"), np.zeros(size), []
    for y in np.array(list(record.channels.values())).T:
        x, now, std = step((x, y), (size, 1, 1))
        found.append(now[0])
    late = slice(1000, None)
    assert np.abs(np.array(found) - expected.force.mean[0])[late].max() < 2e-5 * np.abs(force).max()
    width = (expected.force.upper - expected.force.lower)[0, -1] / (2.0 * 1.96)
    assert std[0] == pytest.approx(width, rel=1e-3)


@needs_gcc
@pytest.mark.parametrize("lost", [(), ("Heave_acceleration",), ("Heave",), ("Heave", "Heave_acceleration")])
def test_the_filter_in_c_goes_through_a_gap_as_the_live_one_does(tmp_path, lost):
    """A second without a sensor, or without any, and on: force and deviation of the live filter, and the truth."""
    model, time, rng = tank_model(), 0.02 * np.arange(1500), np.random.default_rng(3)
    force = 5.0 * np.sin(5.0 * time) + 3.0 * np.sin(7.3 * time + 1.0)
    motion = rss.simulate(model, (time, force), step=0.005).outputs
    levels = {"Heave": 1e-5, "Heave_acceleration": 0.01}
    channels = {name: motion[row] + level * rng.standard_normal(time.size)
                for row, (name, level) in zip((0, 2), levels.items())}
    gap = (time > 20.0) & (time < 21.0)
    channels = {name: np.where(gap & (name in lost), np.nan, values) for name, values in channels.items()}
    if lost == ("Heave",):  # the only one
        channels, levels = {"Heave": channels["Heave"]}, {"Heave": 1e-5}
    live = rss.DualEnKF(model, prior=0.0, n_ensemble=4, learn="never", noise=levels)
    expected = live.run(rss.Record(time, channels, kind="motion-only")).force
    width = (expected.upper - expected.lower)[0] / (2.0 * 1.96)
    source = rss.write_c(live, tmp_path / "filter.c")
    step, size, found = Library(source, "filter_step"), states_of(source), []
    x = np.zeros(size)
    for y in np.array(list(channels.values())).T:
        x, now, std = step((x, y), (size, 1, 1))
        found.append((now[0], std[0]))
    now, std = np.array(found)[900:].T
    assert np.abs(now - expected.mean[0, 900:]).max() < 1e-3 * np.abs(force).max()
    assert std == pytest.approx(width[900:], rel=0.01)
    assert np.abs((now - force[900:]) / std).max() < 5.0
    count = live.engine.state.P.shape[0]
    assert not x[-count**2:].any()  # the gain has settled again


@needs_gcc
def test_the_filter_in_c_is_as_unsure_as_the_live_one(tmp_path):
    """K is known to 15 %: its own gain, settled at the mean, is sure of the force to a fraction of this."""
    model, time, rng = tank_model(), 0.02 * np.arange(1500), np.random.default_rng(4)
    force = 5.0 * np.sin(5.0 * time) + 3.0 * np.sin(7.3 * time + 1.0)
    heave = rss.simulate(model, (time, force)).outputs[0]
    record = rss.Record(time, {"Heave": heave + 1e-4 * rng.standard_normal(time.size)})
    live = rss.DualEnKF(model, learn="never", noise={"Heave": 1e-4}, n_ensemble=100)
    expected = live.run(record).force
    source, count = rss.write_c(live, tmp_path / "filter.c"), live.engine.state.P.shape[0]
    size = states_of(source)
    assert size % count == 0 and size > count + count**2
    step, x, found = Library(source, "filter_step"), np.zeros(size), []
    for y in record.channels["Heave"]:
        x, _, std = step((x, [y]), (size, 1, 1))
        found.append(std[0])
    width = (expected.upper - expected.lower)[0] / (2.0 * 1.96)
    assert np.median(found[500:]) == pytest.approx(np.median(width[500:]), rel=0.3)


def six_coupled_in_pairs():
    """Three pairs, as a ship's symmetry couples them: surge and pitch, sway and roll, heave and yaw."""
    pairs = [coupled_model(pair, seed) for seed, pair in enumerate((SIX[::4], SIX[1:4:2], SIX[2::3]))]
    a, b, c = (block_diag(*(getattr(pair.fit, name) for pair in pairs)) for name in ("a", "b", "c"))
    M, A_inf, C = (block_diag(*(getattr(pair, name) for pair in pairs)) for name in ("M", "A_inf", "C"))
    dofs = tuple(dof for pair in pairs for dof in pair.dofs)
    return rss.Model(dofs, M, A_inf, C, rss.RadiationFit(dofs, a, b, c, a.shape[0]))


@needs_gcc
def test_six_degrees_of_freedom_take_microseconds(tmp_path):
    """Measured in C by a loop of its own; a step of plant and of filter each, the best of five."""
    model = six_coupled_in_pairs()
    time = 0.1 * np.arange(600)
    rng = np.random.default_rng(0)
    record = rss.Record(time, {dof: 0.1 * np.sin(0.6 * time + k) + 1e-3 * rng.standard_normal(600)
                               for k, dof in enumerate(model.dofs)})
    live = rss.DualEnKF(model, noise=dict.fromkeys(SIX, 1e-3), n_ensemble=20, learn="never").prepare(record)
    rss.write_c(model, tmp_path / "plant.c", [("quadratic_drag", "Roll", {"coefficient": 1e6})], dt=0.1)
    rss.write_c(live, tmp_path / "filter.c")
    (tmp_path / "main.c").write_text("""
#include <stdio.h>
#include <time.h>
#include "plant.h"
#include "filter.h"
static double in[3][16384], out[3][16384], w[1 << 20];
static const double *arg[256]; static double *res[256]; static casadi_int iw[1 << 16];
static double timed(int (*f)(const casadi_real**, casadi_real**, casadi_int*, casadi_real*, int), int times) {
  for (int k = 0; k < 3; ++k) { arg[k] = in[k]; res[k] = out[k]; }
  clock_t start = clock();
  for (int i = 0; i < times; ++i) f(arg, res, iw, w, 0);
  return 1e6 * (double)(clock() - start) / CLOCKS_PER_SEC / times;
}
int main(void) {
  double plant = 1e9, filter = 1e9, one;
  for (int i = 0; i < 5; ++i) {
    one = timed(plant_step, 20000); plant = one < plant ? one : plant;
    one = timed(filter_step, 4000); filter = one < filter ? one : filter;
  }
  in[1][0] = 0.0 / 0.0;
  one = timed(filter_step, 200);
  printf("{\\"plant\\": %g, \\"filter\\": %g, \\"gap\\": %g}", plant, filter, one);
}""")
    subprocess.run([GCC, "-O2", "main.c", "plant.c", "filter.c", "-lm", "-o", "main"], check=True, cwd=tmp_path)
    took = json.loads(subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout)
    print(took, model.fit.states)
    assert took["plant"] < 20.0 and took["filter"] < 400.0  # one filter for each of 31 directions of the parameters
    assert took["gap"] < 10000.0  # the covariance of 120 states moves along


def test_a_delay_is_no_part_of_the_unit_and_the_code_and_said(tmp_path):
    model, late = tank_model(), [("excitation_delay", {"delay": 0.05}), ("clock_drift", {"rate": 1e-3})]
    words = "excitation_delay on Heave, clock_drift left out: delays"
    with pytest.warns(rss.errors.InputWarning, match=words):
        rss.write_c(model, tmp_path / "plant.c", late)
    with pytest.warns(rss.errors.InputWarning, match=words):
        rss.write_fmu(model, tmp_path / "plant.fmu", late)


def test_code_of_what_cannot_be_is_refused(tmp_path):
    with pytest.raises(rss.InputError, match=r"ends in \.c"):
        rss.write_c(tank_model(), tmp_path / "plant.cpp")
    with pytest.raises(rss.InputError, match="prepare"):
        rss.write_c(rss.DualEnKF(tank_model()), tmp_path / "filter.c")
    with pytest.raises(rss.InputError, match=r"ends in \.fmu"):
        rss.write_fmu(tank_model(), tmp_path / "plant.zip")
    with pytest.raises(rss.InputError, match=r"fmi3Functions\.h"):
        rss.write_fmu(tank_model(), tmp_path / "plant.fmu", headers=tmp_path)
    with pytest.raises(rss.InputError, match="start: shape"):
        rss.write_fmu(tank_model(), tmp_path / "plant.fmu", start=np.zeros(2))


FMPY = """
import json, sys
import numpy as np
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
case = json.loads(open(sys.argv[1]).read())
made = simulate_fmu(case["path"], start_values=case["start"], stop_time=case["stop"], output_interval=case["interval"],
                    relative_tolerance=1e-12, output=case["outputs"], record_events=False)
simulate_fmu(case["path"], start_values=case["start"], stop_time=0.1, solver="Euler")  # asks for what CVode does not
print(json.dumps({"problems": validate_fmu(case["path"]), "y": [made[name].tolist() for name in case["outputs"]]}))
"""


def fmpy_python():
    """The Python that has FMPy: RADIATION_SS_FMPY, or this one."""
    return os.environ.get("RADIATION_SS_FMPY") or (sys.executable if find_spec("fmpy") else None)


@pytest.mark.skipif(fmpy_python() is None, reason="no FMPy: name a Python that has it in RADIATION_SS_FMPY")
def test_fmpy_gives_the_motion_that_simulate_gives(tmp_path):
    """Released under a constant force: FMPy's CVode and the package's own integrator."""
    python, model = fmpy_python(), tank_model()
    headers = subprocess.run([python, "-c", "import fmpy; print(fmpy.__path__[0])"], check=True, capture_output=True,
                             text=True).stdout.strip()
    states, inputs, outputs = signals_of(model, EFFECTS)
    start = dict.fromkeys(states, 0.0) | {"heave": 0.03}
    found_alone = find_spec("fmpy") is not None
    path = rss.write_fmu(model, tmp_path / "tank.fmu", EFFECTS, headers=None if found_alone else f"{headers}/c-code")
    case = {"path": str(path), "stop": 10.0, "interval": 0.05, "outputs": outputs,
            "start": {f"state.{name}": value for name, value in start.items()} | {"heave_force": 4.0}}
    (tmp_path / "case.json").write_text(json.dumps(case))
    (tmp_path / "run.py").write_text(FMPY)
    run = subprocess.run([python, "run.py", "case.json"], check=True, capture_output=True, text=True, cwd=tmp_path,
                         env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"})
    found = json.loads(run.stdout.strip().splitlines()[-1])
    assert found["problems"] == [] and inputs == ["heave_force"]
    time = 0.05 * np.arange(201)
    begin = list(start.values())[:model.fit.states + 2]
    expected = rss.simulate(model, (time, np.full(201, 4.0)), EFFECTS, start=begin, step=0.0005).outputs
    error = np.abs(np.array(found["y"]) - expected).max(axis=1) / np.abs(expected).max(axis=1)
    assert error.max() < 1e-8
    assert state_equations(model, EFFECTS).size1_in(1) == len(states)


@needs_gcc
def test_a_state_space_of_other_coordinates_is_the_same_plant(tmp_path):
    model = tank_model()
    plant = rss.cummins(model)
    T = np.random.default_rng(0).standard_normal((5, 5)) + 3.0 * np.eye(5)
    moved = ct.ss(T @ plant.A @ np.linalg.inv(T), T @ plant.B, plant.C @ np.linalg.inv(T), plant.D,
                  inputs=plant.input_labels, outputs=plant.output_labels)
    time = np.linspace(0.0, 10.0, 201)
    force = np.sin(5.0 * time)
    steps = Library(rss.write_c(moved, tmp_path / "moved.c", dt=0.05), "plant_step")
    x, last = np.zeros(5), None
    for now in 0.5 * (force[:-1] + force[1:]):
        x, last = steps([np.zeros(1), x, np.array([now])], [5, 3])
    expected = np.asarray(ct.forced_response(plant, time, force).outputs)[0]
    assert last[0] == pytest.approx(expected[-2], abs=0.02 * np.abs(expected).max())
    system = nonlinear_system(moved, [("quadratic_drag", {"coefficient": 0.0})])
    assert system.output_labels == plant.output_labels
