"""Where the gap lies, and the force that is missing."""
