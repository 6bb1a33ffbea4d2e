"""A body whose radiation the model's fit leaves out in part: the truth is simulated with the kernel of the data."""

import numpy as np
import pytest
from scipy.linalg import expm

import radiation_ss as rss

MASS, A_INF, C = 3.0, 1.0, 40.0
POLES = np.array([-0.6 + 2.0j, -0.25 + 3.4j, -0.9 + 5.0j])


def state_space():
    """Return a radiation model of six states: each pair a s / (s^2 + 2 d s + w^2), which no fit of two has."""
    A, B, c = np.zeros((6, 6)), np.zeros((6, 1)), np.zeros((1, 6))
    for k, pole in enumerate(POLES):
        A[2 * k:2 * k + 2, 2 * k:2 * k + 2] = [[0.0, 1.0], [-abs(pole) ** 2, 2 * pole.real]]
        B[2 * k + 1], c[0, 2 * k + 1] = 1.0, (2.0, 1.5, 2.5)[k]
    return A, B, c


def record(damping, seed, duration=120.0, dt=0.05 / 8):
    """Return a record of the body with another linear damping, driven by a known force, exact for straight lines."""
    A, B, c = state_space()
    F = np.zeros((9, 9))
    F[0, 1], F[1, 0], F[1, 1], F[1, 8] = 1.0, -C / (MASS + A_INF), -damping / (MASS + A_INF), 1.0 / (MASS + A_INF)
    F[1, 2:8], F[2:8, 1:2], F[2:8, 2:8] = -c / (MASS + A_INF), B, A
    step = expm(F * dt)
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, dt)
    omega, phase = np.linspace(1.0, 6.0, 60), rng.uniform(0.0, 2 * np.pi, 60)
    force = 0.3 * np.sin(np.minimum(time / 20.0, np.pi / 2)) ** 2 * np.cos(np.outer(time, omega) + phase).sum(axis=1)
    z, x = np.zeros(9), np.zeros(time.size)
    for k in range(1, time.size):
        z[8] = 0.5 * (force[k - 1] + force[k])
        z = step @ z
        x[k] = z[0]
    x += 0.003 * np.std(x) * rng.standard_normal(x.size)
    return rss.Record(time[::8], {"Heave": x[::8], "Heave_force": force[::8]}, kind="forced", name=f"seed {seed}")


@pytest.mark.parametrize("order, damping", [(2, 1.2), (6, 1.2)])
def test_radiation_beyond_the_fit_is_no_effect_and_biases_none(order, damping):
    A, B, c = state_space()
    omega = np.linspace(0.1, 12.0, 120)
    K = np.array([(c @ np.linalg.solve(1j * w * np.eye(6) - A, B))[0, 0] for w in omega])[:, None, None]
    hydro = rss.HydroData(omega=omega, A=A_INF + K.imag / omega[:, None, None], B=K.real, A_inf=[[A_INF]],
                          M=[[MASS]], C=[[C]], dofs=("Heave",))
    model = rss.Model.from_hydro(hydro, order=order)
    found = rss.diagnose(model, [record(damping, 1), record(damping, 2)], withhold=record(damping, 3))
    assert any("leaves out" in note for note in found.notes) == (order == 2)
    assert {e.name for e in found.verdict.effects} == ({"linear_damping"} if damping else set())
    for effect in found.verdict.effects:
        value, std = effect.parameters["coefficient"]
        assert abs(value - damping) < 3.0 * std < 0.3 * damping
