"""Wave-radiation subsystems for python-control.

The folders are the stages of the method and import only down the data flow:
hydro -> fit -> body -> waves -> records -> effects -> simulation -> inference -> filter -> identification -> diagnosis
-> design -> report.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# Public name -> module. Loaded on first use, so that importing the package stays cheap.
_PUBLIC = {
    "RadiationError": "errors",
    "InputError": "errors",
    "SolverError": "errors",
    "HydroData": "hydro.data",
    "read_hydro": "hydro.files",
    "write_hydro": "hydro.files",
    "section_2d": "hydro.section.solver",
    "lewis_section": "hydro.section.shapes",
    "fit_radiation": "fit.radiation",
    "fitfrd": "fit.radiation",
    "RadiationFit": "fit.result",
    "read_fit": "fit.files",
    "audit": "fit.audit",
    "write_fmu": "export.source",
    "write_c": "export.source",
    "fit_excitation": "export.excitation",
    "read_excitation": "export.excitation",
    "Model": "body.model",
    "body": "body.make",
    "read_model": "body.convert",
    "as_model": "body.convert",
    "cummins": "body.composite",
    "rigid_body": "body.composite",
    "mass_matrix": "body.particulars",
    "sampled": "body.discretisation",
    "gap_metric": "design.gap_metric",
    "robust_margin": "design.gap_metric",
    "Spectrum": "waves.spectrum",
    "jonswap": "waves.spectrum",
    "pierson_moskowitz": "waves.spectrum",
    "bretschneider": "waves.spectrum",
    "user_spectrum": "waves.spectrum",
    "realise": "waves.realise",
    "exciting_force": "waves.force",
    "encounter_frequency": "waves.dispersion",
    "wave_frequencies": "waves.dispersion",
    "carry_elevation": "waves.dispersion",
    "linear_response": "simulation.linear",
    "Record": "records.record",
    "as_record": "records.convert",
    "read_record": "records.record_files",
    "write_record": "records.record_files",
    "at_the_body": "records.sensors",
    "in_radians": "records.convert",
    "from_accelerometers": "records.sensors",
    "clock_offset": "records.sensors",
    "joined": "records.sensors",
    "simulate": "simulation.run",
    "prescribed_force": "simulation.driven",
    "Effect": "effects",
    "register_effect": "effects",
    "DualEnKF": "filter.dual_enkf",
    "identify": "identification.identify",
    "Identification": "identification.identify",
    "repeat": "filter.repeated",
    "isolability": "design.isolability",
    "plan_tests": "design.plan",
    "TestPlan": "design.plan",
    "diagnose": "diagnosis.diagnose",
    "Diagnosis": "diagnosis.result",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'radiation_ss' has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    # `rss.body` stays the package of that name, which is called like the function.
    return globals().setdefault(name, value)


def __dir__() -> list[str]:
    return sorted(__all__)
