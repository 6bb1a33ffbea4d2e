"""Places of degrees of freedom in file forms that have six for each body."""

from __future__ import annotations

from pathlib import Path

from radiation_ss.errors import InputError
from radiation_ss.hydro.data import body, mode

ORDER_OF_MODES = {name: k for k, name in enumerate(("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"))}


def six_places(dofs: tuple[str, ...], path: Path) -> tuple[list[int], list[str]]:
    """Return the place of each degree of freedom among 6 for each body, and the bodies."""
    bodies = list(dict.fromkeys(body(dof) for dof in dofs))
    foreign = [dof for dof in dofs if mode(dof) not in ORDER_OF_MODES]
    if foreign:
        raise InputError(f"{path.name}: degree of freedom {foreign[0]!r} has no place in this form; only "
                         f"{', '.join(ORDER_OF_MODES)} have (write .json instead)")
    return [6 * bodies.index(body(dof)) + ORDER_OF_MODES[mode(dof)] for dof in dofs], bodies


def six_names(bodies: list[str]) -> list[str]:
    """Return the names of 6 degrees of freedom for each body."""
    return [f"{name}__{dof}" if len(bodies) > 1 else dof for name in bodies for dof in ORDER_OF_MODES]
