"""Two-dimensional potential flow about a ship section: shapes, free-surface source, panels, solver."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "shapes": "box_section circle_section lewis_section points_section read_section Section",
    "solver": "section_2d FarField SectionChecks SectionSolution solve_section",
    "strips": "strip_theory",
})
