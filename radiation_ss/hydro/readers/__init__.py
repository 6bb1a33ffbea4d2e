"""One module for each file format; every unit, sign and ordering is converted here, at the door."""
