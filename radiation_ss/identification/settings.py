"""Options of `identify`: every number that decides, with what it means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from radiation_ss.errors import InputError

TOLERANCES = {"mass": 0.02, "A_inf": 0.02, "stiffness": 0.02, "kernel": 0.01, "force": 0.05, "sensor": 0.005}


@dataclass(frozen=True)
class Settings:
    """Options of `identify` beside its arguments.

    Parameters
    ----------
    tolerance : float or mapping of str to float, optional
        Relative standard deviations of what the model states: one number, or by name. "mass", "A_inf", "stiffness",
        0.02; "force" (X): 0.05; "kernel" (what the model's order leaves out of K): 0.01 or the fit's own error if that
        is larger; "sensor" (gain of the motion sensors): 0.005. "force" and "sensor" enter where the force is known,
        "kernel" there and with several degrees of freedom.
    point_tolerance : float
        Relative standard deviation of K at the points.
    draws : int
        Number of draws kept of the posterior.
    least_passive : float
        Share of the posterior that must be passive for the rest to be left out.
    contradiction, doubt : float
        A warning names a number that moves more than `contradiction` prior standard deviations, a nominal one beyond
        its tolerance and `doubt` of its own standard deviations.
    nonlinear, most_laws : float, int
        Chance of a false warning about a nonlinear law; number of laws that are taken into the model.
    misfit : float
        Chance of a false warning about prediction errors that noise does not explain.
    preset : {None, "paper"}
        Of the dual filter: as printed, with Q_theta, Q_state, Q_force, R and `units` as `DualEnKF` takes them.
    filter : mapping
        More options of `DualEnKF`.
    """

    tolerance: float | Mapping[str, float] | None = None
    point_tolerance: float = 1e-3
    draws: int = 1000
    least_passive: float = 0.02
    contradiction: float = 3.0
    doubt: float = 2.5
    nonlinear: float = 0.04
    most_laws: int = 2
    misfit: float = 1e-4
    preset: str | None = None
    filter: Mapping[str, Any] = field(default_factory=dict)

    @property
    def tolerances(self) -> dict[str, float]:
        """A tolerance for each name: one number for all, or by name, the default where not named."""
        given = {} if self.tolerance is None else self.tolerance
        if not isinstance(given, Mapping):
            given = dict.fromkeys(TOLERANCES, given)
        unknown = [name for name in given if name not in TOLERANCES]
        if unknown:
            raise InputError(f"tolerance: {unknown[0]!r} is unknown; use {', '.join(TOLERANCES)}")
        out = TOLERANCES | {name: float(value) for name, value in given.items()}
        for name, value in out.items():
            if not 0.0 <= value < 1.0:
                raise InputError(f"tolerance: {name} relative standard deviation from 0 to below 1 needed, found "
                                 f"{value}")
        return out


FILTER = ("Q_theta", "Q_state", "Q_force", "R", "units", "analysis", "inflation", "order", "n_ensemble")


def settings_of(options: Mapping[str, Any]) -> Settings:
    """Return the settings with some changed; those of the dual filter by their own names too."""
    known = [name for name in Settings.__dataclass_fields__ if name != "filter"]
    unknown = [name for name in options if name not in (*known, *FILTER)]
    if unknown:
        raise InputError(f"identify: option {unknown[0]!r} is unknown; there are {', '.join((*known, *FILTER))}")
    return Settings(**{name: value for name, value in options.items() if name in known},
                    filter={name: value for name, value in options.items() if name in FILTER})
