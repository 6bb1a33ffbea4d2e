"""Measured records: data, files, checks."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "column_checks": "column_conflicts",
    "columns": "channel_unit",
    "convert": "to_pandas to_xarray",
    "faults": "without_faults",
    "record_checks": "named_apart since_release suspicions",
    "signals": "filled",
})
