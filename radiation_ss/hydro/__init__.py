"""Frequency-domain hydrodynamic coefficients: data, files, transforms, checks, the 2-D section solver."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "clean": "velocity_transform",
    "findings": "Finding QualityReport",
    "linear_waves": "group_velocity wave_number",
    "section.shapes": "box_section circle_section points_section read_section",
    "section.solver": "solve_section",
    "section.strips": "strip_theory",
    "transforms": "added_mass_from_damping estimate_A_inf fit_tail kernel exponential_integral",
})
