"""Measured records: data, files, checks."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "columns": "channel_unit",
    "convert": "to_pandas to_xarray",
    "record_checks": "named_apart since_release suspicions without_clipped",
    "signals": "column_conflicts filled",
})
