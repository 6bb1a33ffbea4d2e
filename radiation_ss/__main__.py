"""Run the command line with `python -m radiation_ss`."""

from radiation_ss.cli import main

raise SystemExit(main())
