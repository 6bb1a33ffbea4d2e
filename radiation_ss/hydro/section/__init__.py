"""Two-dimensional potential flow about a ship section: shapes, free-surface source, panels, solver."""

from radiation_ss.hydro.section.checks import FarField, SectionChecks
from radiation_ss.hydro.section.offsets import points_section, read_section
from radiation_ss.hydro.section.shapes import Section, box_section, circle_section, lewis_section
from radiation_ss.hydro.section.solver import SectionSolution, section_2d, solve_section
from radiation_ss.hydro.section.strips import strip_theory

__all__ = ["FarField", "Section", "SectionChecks", "SectionSolution", "box_section", "circle_section", "lewis_section",
           "points_section", "read_section", "section_2d", "solve_section", "strip_theory"]
