"""HydroData: shapes and units are checked at the door, selection and scaling keep the physics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiation_ss import HydroData, InputError


def two_modes(**changes):
    omega = np.array([0.5, 1.0, 2.0])
    A = np.array([[[2.0, 0.3], [0.3, 1.0]]]) * (1.0 + 1.0 / omega)[:, None, None]
    B = np.array([[[1.0, 0.2], [0.2, 0.5]]]) * omega[:, None, None]
    fields = {"omega": omega, "A": A, "B": B, "A_inf": 0.5 * A[-1], "dofs": ("Sway", "Roll"), "X": np.ones((3, 1, 2))}
    return HydroData(**{**fields, **changes})


def test_frd_is_native_and_holds_K():
    data = two_modes()
    response = data.to_frd()
    assert response.input_labels == ["sway_vel", "roll_vel"]
    np.testing.assert_allclose(np.moveaxis(response.complex, -1, 0), data.K, rtol=1e-14)


def test_selection_reorders_every_field():
    data = two_modes().select(["Roll", "Sway"])
    np.testing.assert_array_equal(data.A[:, 0, 0], two_modes().A[:, 1, 1])
    assert data.X.shape == (3, 1, 2) and data.dofs == ("Roll", "Sway")


@given(st.floats(1e-3, 1e3))
def test_a_longer_body_has_proportionally_more_of_everything(length):
    data = two_modes().times(length)
    np.testing.assert_allclose(data.K, length * two_modes().K, rtol=1e-12)


def test_arrays_cannot_be_changed_behind_the_checks():
    with pytest.raises(ValueError, match="read-only"):
        two_modes().A[0, 0, 0] = 1.0


@pytest.mark.parametrize("changes, says", [
    ({"omega": [0.5, 0.5, 1.0]}, "ascend"), ({"omega": [0.0, 0.5, 1.0]}, "positive"),
    ({"A": np.ones((3, 2, 1))}, "A: shape"), ({"dofs": ()}, "dofs"), ({"dofs": ("Sway", "Sway")}, "twice"),
    ({"rho": -1.0}, "rho"), ({"depth": 0.0}, "depth"), ({"B": np.full((3, 2, 2), np.nan)}, "not finite"),
    ({"A": "text"}, "not an array of numbers"), ({"X": np.ones((3, 2, 2))}, "directions: missing"),
    ({"X": np.ones((3, 2, 2)), "directions": [0.0, 90.0]}, "directions: 90 is too much for radians")])
def test_bad_fields_are_named(changes, says):
    with pytest.raises(InputError, match=says):
        two_modes(**changes)


@pytest.mark.parametrize("one, other", [(0.0, 0.0), (0.0, 2.0 * np.pi), (-np.pi, np.pi)])
def test_one_direction_has_one_force(one, other):
    X = np.tile([[1.0, 2.0], [3.0, 4.0], [1.0, 2.0]], (3, 1, 1)).astype(complex)
    assert two_modes(X=X, directions=[one, 1.0, other]).X.shape == (3, 3, 2)  # twice the same: no contradiction
    X[1, 2, 0] *= 1.1
    with pytest.raises(InputError, match="are one direction, and have different forces"):
        two_modes(X=X, directions=[one, 1.0, other])


def test_unknown_degree_of_freedom_is_named():
    with pytest.raises(InputError, match="Heave"):
        two_modes().select("Heave")


@pytest.mark.parametrize("length", [0.0, -1.0, np.inf, np.nan])
def test_length_must_be_positive(length):
    with pytest.raises(InputError, match="length"):
        two_modes().times(length)


def test_what_moves_along_is_coupled_step_by_step():
    omega, dofs = np.linspace(0.5, 2.0, 4), ("Surge", "Sway", "Heave", "Roll", "Yaw")
    A = np.diag([10.0, 20.0, 30.0, 4.0, 5.0]) + np.zeros((4, 1, 1))
    A[:, 1, 3] = A[:, 3, 1] = -2.0      # sway with roll, roll with yaw by damping, surge with heave by rounding only
    A[:, 0, 2] = A[:, 2, 0] = 1e-3
    B = 0.1 * A * (A > 0.0) + np.where(np.add.outer(np.arange(5), np.arange(5)) == 7, 0.2, 0.0)
    data = HydroData(omega, A, B, dofs=dofs, C=np.diag([0.0, 0.0, 50.0, 6.0, 0.0]))
    assert data.coupled(["Yaw"]) == ("Sway", "Roll", "Yaw")
    assert data.coupled(["Heave"]) == ("Heave",) and data.coupled([]) == ()
    B[:, [0, 0, 2, 2], [0, 2, 0, 2]] = 1e-9     # rounding of panels, where nothing radiates or restores
    C = data.C.copy()
    C[[0, 2], [2, 0]] = 1e-9
    assert data.replace(B=B, C=C).coupled(["Heave"]) == ("Heave",)
