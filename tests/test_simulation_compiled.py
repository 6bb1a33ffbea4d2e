"""Instructions run by the interpreter against CasADi's own evaluation."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plant_bodies import coupled_model
from scipy.linalg import expm

from radiation_ss import Record
from radiation_ss.effects import Active, library
from radiation_ss.errors import InputError, SolverError
from radiation_ss.simulation import CODES, OPERATIONS, Compiled, Rollout, half_steps, prepare

EPS = np.finfo(float).eps
ONE = {"OP_NEG": lambda a: -a, "OP_SQ": lambda a: a * a, "OP_TWICE": lambda a: a + a, "OP_INV": lambda a: 1.0 / a,
       "OP_SIN": ca.sin, "OP_COS": ca.cos, "OP_TANH": ca.tanh, "OP_EXP": ca.exp, "OP_SQRT": ca.sqrt,
       "OP_FABS": ca.fabs, "OP_SIGN": ca.sign, "OP_NOT": ca.logic_not, "OP_LOG": ca.log, "OP_TAN": ca.tan,
       "OP_ASIN": ca.asin, "OP_ACOS": ca.acos, "OP_ATAN": ca.atan, "OP_SINH": ca.sinh, "OP_COSH": ca.cosh,
       "OP_ASINH": ca.asinh, "OP_ACOSH": lambda a: ca.acosh(1.0 + ca.fabs(a)), "OP_ATANH": ca.atanh,
       "OP_FLOOR": lambda a: ca.floor(3.0 * a), "OP_CEIL": lambda a: ca.ceil(3.0 * a), "OP_ERF": ca.erf,
       "OP_LOG1P": ca.log1p, "OP_EXPM1": ca.expm1, "OP_CONSTPOW": lambda a: ca.constpow(a, 1.7)}
TWO = {"OP_ADD": lambda a, b: a + b, "OP_SUB": lambda a, b: a - b, "OP_MUL": lambda a, b: a * b,
       "OP_DIV": lambda a, b: a / b, "OP_IF_ELSE_ZERO": lambda a, b: ca.if_else(a > 0.4, b, 0.0),
       "OP_LT": lambda a, b: a < b, "OP_LE": lambda a, b: a <= b, "OP_EQ": lambda a, b: a == b,
       "OP_NE": lambda a, b: a != b, "OP_AND": lambda a, b: ca.logic_and(a > 0.4, b), "OP_FMIN": ca.fmin,
       "OP_OR": lambda a, b: ca.logic_or(a > 0.4, b > 0.4), "OP_FMAX": ca.fmax, "OP_POW": lambda a, b: a**b,
       "OP_ATAN2": ca.atan2, "OP_FMOD": lambda a, b: ca.fmod(5.0 * a, b), "OP_COPYSIGN": lambda a, b:
       ca.copysign(a, b - 0.5), "OP_HYPOT": ca.hypot}
SILENT = {"OP_INPUT", "OP_OUTPUT", "OP_ASSIGN", "OP_LIFT"}


def test_every_operation_is_tested():
    assert {*ONE, *TWO, *SILENT} == set(OPERATIONS)


@pytest.mark.parametrize("name", [*ONE, *TWO])
def test_each_operation_gives_what_casadi_gives(name):
    a, b, p = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("p")
    value = ONE[name](a) if name in ONE else TWO[name](a, b)
    fixed = ONE[name](p) if name in ONE else TWO[name](p, p + 0.1)
    whole = ca.Function("whole", [a, b, p], [ca.densify(value), ca.densify(fixed)])
    made = Compiled(whole)
    used = {whole.instruction_id(k) for k in range(whole.n_instructions())}
    assert CODES[getattr(ca, name)] in {CODES.get(code) for code in used}
    samples = np.random.default_rng(0).uniform(0.05, 0.95, (77, 2))
    samples[0] = 0.5  # equal, too
    found = made.all(77, samples[:, :1, None], samples[:, 1:, None], np.array([0.3]))
    for k, (one, two) in enumerate(samples):
        expected = [float(v) for v in whole(one, two, 0.3)]
        assert [found[0][k, 0, 0], found[1][k, 0, 0]] == pytest.approx(expected, rel=8 * EPS, abs=8 * EPS)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 100))
def test_what_parameters_alone_decide_is_evaluated_once(seed, count):
    rng = np.random.default_rng(seed)
    x, y, p = ca.SX.sym("x", 2, 3), ca.SX.sym("y", 2), ca.SX.sym("p", 3)
    outputs = [ca.mtimes(ca.vertcat(ca.horzcat(ca.sin(p[0]), p[1]), ca.horzcat(p[2], p[0] * p[1])), x), ca.cos(p),
               ca.densify(ca.SX(2, 2)), y * p[1] + x[:, 0] ** 2]
    whole = ca.Function("whole", [x, y, p], outputs)
    made = Compiled(whole)
    assert len(made.once) >= 4  # sin, product and cosines
    at, same, values = rng.standard_normal((count, 3, 2)), rng.standard_normal(2), rng.standard_normal(3)
    found = made.all(count, at, same, values)
    for k in range(count):
        for one, other in zip(found, whole(at[k].T, same, values)):
            assert np.allclose(one[k].T, np.asarray(other), rtol=16 * EPS, atol=16 * EPS)


def test_a_function_without_parameters_or_without_samples_to_vary():
    x, p = ca.SX.sym("x"), ca.SX.sym("p", 0)
    assert Compiled(ca.Function("f", [x, p], [x**2]))(3, np.array([1.0, 2.0, 3.0])[:, None, None],
                                                      np.zeros(0))[:, 0, 0].tolist() == [1.0, 4.0, 9.0]
    assert Compiled(ca.Function("f", [x, p], [ca.SX(4.0)]))(2, np.zeros((2, 1, 1)), np.zeros(0)).ravel().tolist() == [
        4.0, 4.0]


def test_division_by_zero_and_roots_of_negatives_are_no_error():
    x, p = ca.SX.sym("x"), ca.SX.sym("p", 0)
    made = Compiled(ca.Function("f", [x, p], [1.0 / x, ca.sqrt(x), ca.log(x), ca.sin(x) / x]))
    found = np.array([values.ravel() for values in made.all(2, np.array([0.0, -1.0])[:, None, None], np.zeros(0))])
    assert found[0, 0] == np.inf and found[2, 0] == -np.inf and np.isnan(found[1:3, 1]).all() and np.isnan(found[3, 0])


def test_an_operation_that_cannot_be_run_is_named():
    x, p = ca.SX.sym("x"), ca.SX.sym("p", 0)
    with pytest.raises(InputError, match="not supported"):
        Compiled(ca.Function("strange", [x, p], [ca.erfinv(x)]))


def joined_drive(rng, steps, n):
    """A random drive at start, middle and end of steps, where a step ends that at which the next one starts."""
    drive = rng.standard_normal((steps + 1, 9, n))
    drive[:-1, 2::3] = drive[1:, ::3]
    return drive


@pytest.mark.parametrize("name", ["quadratic_drag", "hysteresis", "tank_resonance", "added_inertia"])
@pytest.mark.parametrize("seed", range(2))
def test_a_path_is_lawsons_method_written_out(name, seed):
    """Stage by stage with CasADi's own evaluation and dense matrices."""
    model, effect = coupled_model(), library()[name]
    rng = np.random.default_rng(seed)
    rollout = Rollout(model, [Active(effect, "Roll", {})], h=0.05)
    steps, n, ns = 12, model.n, rollout.ns
    drive, time = joined_drive(rng, steps, n), 0.05 * np.arange(steps + 1)
    p, s = 0.1 + rng.random(rollout.np), 0.1 * rng.standard_normal(ns)
    states, (stages, _) = rollout.path(s, drive, time, p)
    A, h, v = rollout.linear, rollout.h, model.fit.states + n
    half, whole = expm(0.5 * h * A), expm(h * A)

    def beyond(point, k, at):
        here = drive[k, [at, 3 + at, 6 + at]].T
        _, rest, linear, own = (np.asarray(f) for f in rollout.equations.core(point, here, time[k] + 0.5 * h * at, p))
        acceleration = (linear @ point)[:, None] + rest
        rate = np.zeros(ns)
        rate[rollout.rows] = np.concatenate([acceleration.ravel(), own.ravel()])
        rate[v:v + n] -= (A @ point)[v:v + n]
        return rate, acceleration.ravel()

    for k in range(steps):
        points = [s, None, None, None]
        k1, a1 = beyond(points[0], k, 0)
        points[1] = half @ (s + 0.5 * h * k1)
        k2, a2 = beyond(points[1], k, 1)
        points[2] = half @ s + 0.5 * h * k2
        k3, a3 = beyond(points[2], k, 1)
        points[3] = whole @ s + h * half @ k3
        k4, a4 = beyond(points[3], k, 2)
        size = max(np.abs(points).max(), np.abs([a1, a2, a3, a4]).max())
        expected = np.array([np.concatenate(pair) for pair in zip(points, (a1, a2, a3, a4))])
        assert np.allclose(stages[k], expected, atol=1e4 * EPS * size)
        s = whole @ s + h / 6.0 * (whole @ k1 + 2.0 * half @ (k2 + k3) + k4)
        assert np.allclose(states[k + 1], s, atol=1e4 * EPS * size)


@pytest.mark.parametrize("spring, accuracy, said", [(-1e15, 1e-4, "grows without bounds"), (1.0, 1e-15, "than 20000")])
def test_a_path_ends_where_the_motion_grows_or_its_steps_are_split_too_often(spring, accuracy, said):
    """All steps in the shortest parts would be 1.6 million of them."""
    model, steps = coupled_model(), 400
    rollout = Rollout(model, [Active(library()["cubic_stiffness"], "Roll", {})], 0.05, 12, accuracy, most=20_000)
    drive, time = joined_drive(np.random.default_rng(0), steps, model.n), 0.05 * np.arange(steps + 1)
    with pytest.raises(SolverError, match=said):
        rollout.path(0.1 * np.ones(rollout.ns), drive, time, np.full(rollout.np, spring))


@pytest.mark.parametrize("name", ["quadratic_drag", "hysteresis", "added_inertia"])
@pytest.mark.parametrize("steps, share", [(1, 1.0), (60, 0.4), (60, 0.0)])
def test_derivatives_of_a_path_are_the_chain_rule_written_out(name, steps, share):
    """Stage by stage by CasADi's own Jacobians, with directions that move all, some or no parameters."""
    model, rng = coupled_model(), np.random.default_rng(steps)
    rollout = Rollout(model, [Active(library()[name], "Roll", {})], h=0.05)
    drive, time = joined_drive(rng, steps, model.n), 0.05 * np.arange(steps + 1)
    p, start = 0.1 + rng.random(rollout.np), 0.1 * rng.standard_normal(rollout.ns)
    _, parts = rollout.path(start, drive, time, p)
    stages, _ = parts
    columns = rng.standard_normal((rollout.np, 7)) * (rng.random((rollout.np, 7)) < share)
    d = rng.standard_normal((rollout.ns, 7))
    found = rollout.derivatives(parts, drive, time, p, columns, d)

    h, half, whole, size = rollout.h, rollout.half[0], expm(rollout.h * rollout.linear), np.abs(d).max()
    for k in range(steps):
        def rate(stage, d_stage, k=k):
            at, full = (0, 1, 1, 2)[stage], np.zeros_like(d_stage)
            slope = rollout.equations.slope(stages[k, stage], drive[k, [at, 3 + at, 6 + at]].T,
                                            time[k] + 0.5 * h * at, p)
            full[rollout.rows] = np.asarray(slope) @ np.concatenate([d_stage, columns])
            return full

        r0 = rate(0, d)
        r1 = rate(1, half @ (d + 0.5 * h * r0))
        r2 = rate(2, half @ d + 0.5 * h * r1)
        r3 = rate(3, whole @ d + h * half @ r2)
        d = whole @ d + h / 6.0 * (whole @ r0 + 2.0 * half @ (r1 + r2) + r3)
        size = max(size, np.abs(d).max())
        assert np.allclose(found[k + 1], d, rtol=0.0, atol=1e4 * EPS * size)


def test_the_force_is_read_anew_where_its_times_move():
    """A record's drive is kept while the times at which its force acts stay, and only then."""
    model, time = coupled_model(), 0.05 * np.arange(201)
    rest = {dof: np.zeros(time.size) for dof in model.dofs}
    records = [Record(time, {**rest, **{f"{dof}_force": size * np.sin(time + k) for k, dof in enumerate(model.dofs)}})
               for size in (1.0, 2.0)]
    one, two = (prepare(model, record, 0.05) for record in records)
    late = Rollout(model, [Active(library()["excitation_delay"], "", {})], h=0.05)
    prompt = Rollout(model, [], h=0.05)
    for prepared in (one, two, one):
        assert np.array_equal(prompt.drive(prepared, np.zeros(0)), prepared.drive())
        for delay in (0.1, 0.1, 0.3, 0.1):
            clock = np.repeat(half_steps(prepared.grid)[:, None] - delay, model.n, axis=1)
            assert np.allclose(late.drive(prepared, np.array([delay])), prepared.drive(clock), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("width", [0.02, 0.002])
def test_steps_split_where_friction_sets_in_give_what_short_ones_give(width):
    """A body that sticks between swings: path and derivatives at the steps' ends, in a fraction of the parts."""
    model, levels, h = coupled_model(), 8, 0.1
    friction = Active(library()["coulomb_friction"], "Roll", {"force": 4e5, "width": width, "sharpness": 4.0})

    def run(step, halvings):
        rollout = Rollout(model, [friction], step, halvings)
        time = step * np.arange(round(20.0 / step) + 1)
        at = time[:, None] + step * np.array([0.0, 0.5, 1.0])
        drive = np.zeros((time.size, 9, model.n))
        drive[:, :3] = 1e6 * np.sin(1.3 * at)[:, :, None]
        columns, still = np.eye(rollout.np)[:, :2], np.zeros((rollout.ns, 2))
        states, parts = rollout.path(still[:, 0], drive, time, friction.vector)
        return states, rollout.derivatives(parts, drive, time, friction.vector, columns, still), parts

    (x, dx, (_, parts)), (y, dy, (_, all_parts)) = run(h, levels), run(h / 2**levels, 0)
    y, dy = y[::2**levels], dy[::2**levels]
    assert np.abs(x - y).max() < 1e-4 * np.abs(y).max()
    assert np.abs(dx - dy).max(axis=(0, 1)) == pytest.approx(0.0, abs=2e-2 * np.abs(dy).max())
    assert parts[:, 2].max() > 2 and len(parts) < 0.02 * len(all_parts)


@pytest.mark.filterwarnings("error")
def test_derivatives_that_grow_without_bounds_are_not_known():
    """An unstable body at rest: the path stays, e^(s t) of its derivatives is no number at last."""
    model = coupled_model()
    rollout = Rollout(model, [Active(library()["linear_damping"], "Roll", {})], h=0.05)
    time, p = 0.05 * np.arange(20_000), np.array([-5e6])
    grown = np.linalg.eigvals(closed(model, -5e6)).real.max() * time
    motion = rollout.run(np.zeros(rollout.ns), np.zeros((time.size, 9, model.n)), time, p,
                         columns=np.zeros((1, rollout.ns)), d_start=np.eye(rollout.ns))
    known = np.isfinite(motion.d_state).all(axis=(1, 2))
    assert not motion.state.any() and known[grown < 300.0].all() and not known[grown > 400.0].any()


def closed(model, coefficient):
    """Return the state matrix of a model with damping of its second motion."""
    F, G = model.matrices()
    v = model.fit.states + model.n
    F[:, v + 1] -= coefficient * G[:, 1]
    return F
