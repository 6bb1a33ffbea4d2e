"""Wave-radiation subsystems for python-control.

The folders are the stages of the method and import only down the data flow:
hydro -> fit -> body -> waves -> records -> effects -> simulation -> inference -> filter -> identification -> diagnosis
-> design -> report.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# Public names by module. Loaded on first use, so that importing the package stays cheap.
_PUBLIC = {name: module for module, names in {
    "errors": "RadiationError InputError SolverError",
    "hydro.data": "HydroData",
    "hydro.files": "read_hydro write_hydro",
    "hydro.linear_waves": "encounter_frequency wave_frequencies",
    "hydro.section.solver": "section_2d",
    "hydro.section.shapes": "lewis_section",
    "fit.radiation": "fit_radiation fitfrd",
    "fit.result": "RadiationFit",
    "fit.files": "read_fit",
    "fit.audit": "audit",
    "export.c_source": "write_c",
    "export.fmu": "write_fmu",
    "export.excitation": "fit_excitation read_excitation",
    "body.model": "Model",
    "body.make": "body",
    "body.convert": "read_model as_model",
    "body.composite": "cummins rigid_body mass_matrix",
    "body.discretisation": "sampled",
    "design.gap_metric": "gap_metric robust_margin",
    "waves.spectrum": "Spectrum jonswap pierson_moskowitz bretschneider user_spectrum",
    "waves.realise": "realise",
    "waves.force": "exciting_force",
    "simulation.linear": "linear_response",
    "records.record": "Record",
    "records.convert": "as_record in_radians",
    "records.record_files": "read_record write_record",
    "records.probe": "at_the_body carry_elevation",
    "records.sensors": "from_accelerometers clock_offset joined",
    "simulation.run": "simulate",
    "simulation.driven": "prescribed_force",
    "effects": "Effect register_effect",
    "filter.dual_enkf": "DualEnKF",
    "identification.identify": "identify",
    "identification.result": "Identification",
    "filter.repeated": "repeat",
    "design.isolability": "isolability",
    "design.plan": "plan_tests TestPlan",
    "diagnosis.diagnose": "diagnose",
    "diagnosis.result": "Diagnosis",
}.items() for name in names.split()}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'radiation_ss' has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    # `rss.body` stays the package of that name, which is called like the function.
    return globals().setdefault(name, value)


def __dir__() -> list[str]:
    return sorted(__all__)
