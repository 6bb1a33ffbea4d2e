"""Plots, tables and the HTML page."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {"demo": "tank_hydro tank_model"})
