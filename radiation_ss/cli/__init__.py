"""The command line: radiation-ss VERB ... (see `radiation-ss --help`)."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {"arguments": "main parser"})
