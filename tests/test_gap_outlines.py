"""Bodies that change in time: another integrator makes the motion; no law of the library may be blamed."""

import numpy as np
import pytest
from gap_cases import tank_case
from plant_bodies import tank_model
from scipy.integrate import solve_ivp

from radiation_ss.effects import activate, effect_named, library, outlines
from radiation_ss.gap.diagnose import diagnose
from radiation_ss.records.record import Record
from radiation_ss.simulation.run import simulate

DURATION = 30.0
TIME = np.arange(0.0, DURATION, 0.05)


def measured(stiffness, inertia, seed):
    """Records of the tank whose stiffness and inertia change by these shares of time, by a stiff library integrator."""
    model, rng = tank_model(), np.random.default_rng(seed)
    omega = np.linspace(4.0, 12.0, 40)
    phases = rng.uniform(0.0, 2.0 * np.pi, omega.size)
    sizes = np.exp(-(((omega - 8.0) / 1.5) ** 2))

    def record(name, size, x0):
        def force(t):
            return size * sizes @ np.cos(np.multiply.outer(omega, t) + phases.reshape(-1, *[1] * np.ndim(t)))

        def rate(t, s):
            memory, x, v = s[:-2], s[-2], s[-1]
            total = (model.M + model.A_inf)[0, 0] * (1.0 + inertia(t / DURATION))
            a = (force(t) - (model.fit.c @ memory)[0] - model.C[0, 0] * (1.0 + stiffness(t / DURATION)) * x) / total
            return np.concatenate([model.fit.a @ memory + model.fit.b[:, 0] * v, [v, a]])

        begin = np.zeros(model.fit.states + 2)
        begin[-2] = x0
        x = solve_ivp(rate, (0.0, TIME[-1]), begin, t_eval=TIME, method="LSODA", rtol=1e-8, atol=1e-11).y[-2]
        x = x + 0.005 * x.std() * rng.standard_normal(x.size)
        return Record(TIME, {"Heave": x, "Heave_force": force(TIME)}, kind="waves", name=name)

    return model, [record("small", 1.0, 0.0), record("large", 2.0, 0.01)]


def nothing(share):
    return 0.0 * share


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("place, law", [("stiffness_drift", lambda s: -0.3 * s), ("inertia_drift", lambda s: 0.3 * s),
                                        ("stiffness_drift", lambda s: -0.4 * (1.0 - np.exp(-2.0 * s)))])
def test_a_body_that_changes_in_time_is_described_and_not_named(place, law, seed):
    model, records = measured(*((law, nothing) if place == "stiffness_drift" else (nothing, law)), seed)
    found = diagnose(model, records)
    assert found.verdict.status == "unknown_effect" and not found.verdict.effects
    (outline,) = found.verdict.outline
    assert outline.name == place
    # The end of the record is seen as well as the tolerance of the number that changes allows.
    change = sum(outline.parameters[name][0] for name in ("linear", "quadratic"))
    size = (model.C if place == "stiffness_drift" else model.M + model.A_inf)[0, 0]
    assert change / size == pytest.approx(law(1.0), abs=3 * 0.02)
    assert "changes in time" in found.sentence and place.replace("_", " ") in found.sentence
    assert "once more" in found.verdict.next_record
    assert found.corrected.effects == ()


def test_an_outline_that_is_asked_for_is_an_effect():
    model, records = measured(lambda s: -0.3 * s, nothing, 0)
    found = diagnose(model, records, ["quadratic_drag", "clock_drift", "stiffness_drift"])
    assert [e.name for e in found.verdict.effects] == ["stiffness_drift"]
    assert found.how_far.gap_after < 0.2 * found.how_far.gap_retuned


@pytest.mark.parametrize("name, values", [("cubic_stiffness", {"stiffness": 3e5}),
                                          ("quadratic_drag", {"coefficient": 150.0})])
def test_a_law_of_the_motion_in_dying_decays_is_no_change_in_time(name, values):
    # Within one decay amplitude falls with time; the records begin at two amplitudes.
    model, records = tank_case([(name, values)], seed=1, kinds=("decay", "decay"), noise=0.003, duration=10.0)
    found = diagnose(model, records)
    assert [e.name for e in found.verdict.effects] == [name]


def test_outlines_stand_beside_the_library():
    assert not set(outlines()) & set(library())
    assert all(effect_named(name).outline for name in outlines())


def test_an_outline_is_linear_in_time_from_the_start_of_the_clock():
    """Force of the outline against its formula: motion under it is that of a body with the changed stiffness."""
    model, records = measured(lambda s: 0.2 * s, nothing, 3)
    (active,) = activate([("stiffness_drift", {"linear": 0.2 * model.C[0, 0], "duration": DURATION})], model.dofs)
    begin = np.zeros(model.fit.states + 2)
    begin[-2] = 0.01
    x = simulate(model, (TIME, records[1].channels["Heave_force"]), [active], start=begin).outputs[0]
    difference = records[1].channels["Heave"] - x
    assert difference.std() < 1.2 * 0.005 * x.std()  # the noise
