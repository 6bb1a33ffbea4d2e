"""The rigid body with its radiation memory: composite systems, sampling, robustness measures."""
