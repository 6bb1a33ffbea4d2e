"""Public names for type checkers; `__init__.py` loads them on first use."""

from radiation_ss.body.composite import cummins as cummins
from radiation_ss.body.composite import rigid_body as rigid_body
from radiation_ss.body.discretisation import sampled as sampled
from radiation_ss.body.gap_metric import gap_metric as gap_metric
from radiation_ss.body.gap_metric import robust_margin as robust_margin
from radiation_ss.body.model import Model as Model
from radiation_ss.body.model import read_model as read_model
from radiation_ss.body.rigid import mass_matrix as mass_matrix
from radiation_ss.design.isolability import isolability as isolability
from radiation_ss.design.plan import TestPlan as TestPlan
from radiation_ss.design.plan import plan_tests as plan_tests
from radiation_ss.effects import Effect as Effect
from radiation_ss.effects import register_effect as register_effect
from radiation_ss.errors import InputError as InputError
from radiation_ss.errors import RadiationError as RadiationError
from radiation_ss.errors import SolverError as SolverError
from radiation_ss.export.excitation import fit_excitation as fit_excitation
from radiation_ss.export.excitation import read_excitation as read_excitation
from radiation_ss.filter.dual_enkf import DualEnKF as DualEnKF
from radiation_ss.filter.repeat import repeat as repeat
from radiation_ss.fit.audit import audit as audit
from radiation_ss.fit.files import read_fit as read_fit
from radiation_ss.fit.radiation import fit_radiation as fit_radiation
from radiation_ss.fit.radiation import fitfrd as fitfrd
from radiation_ss.fit.result import RadiationFit as RadiationFit
from radiation_ss.gap.diagnose import Diagnosis as Diagnosis
from radiation_ss.gap.diagnose import diagnose as diagnose
from radiation_ss.hydro.data import HydroData as HydroData
from radiation_ss.hydro.files import read_hydro as read_hydro
from radiation_ss.hydro.files import write_hydro as write_hydro
from radiation_ss.hydro.section import lewis_section as lewis_section
from radiation_ss.hydro.section import section_2d as section_2d
from radiation_ss.identification.identify import Identification as Identification
from radiation_ss.identification.identify import identify as identify
from radiation_ss.records.record import Record as Record
from radiation_ss.records.record import read_record as read_record
from radiation_ss.records.record import write_record as write_record
from radiation_ss.simulation.linear import linear_response as linear_response
from radiation_ss.simulation.run import simulate as simulate
from radiation_ss.waves.force import exciting_force as exciting_force
from radiation_ss.waves.realise import realise as realise
from radiation_ss.waves.spectrum import Spectrum as Spectrum
from radiation_ss.waves.spectrum import bretschneider as bretschneider
from radiation_ss.waves.spectrum import jonswap as jonswap
from radiation_ss.waves.spectrum import pierson_moskowitz as pierson_moskowitz
from radiation_ss.waves.spectrum import user_spectrum as user_spectrum

__version__: str
_PUBLIC: dict[str, str]
