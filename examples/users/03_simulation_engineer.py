"""
For simulation engineers: radiation models for other programs
=============================================================

Check the coefficients of a panel code, fit a passive model, export it, and score the model that is in use.
"""

# %%
# Coefficients. In practice ``rss.read_hydro("platform.1")``: WAMIT, NEMOH, AQWA, BEMIO, Capytaine or MSS.
import tempfile
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import radiation_ss as rss

section = rss.section_2d(rss.lewis_section(10.0, 8.0, 0.95), np.linspace(0.1, 3.0, 60), gyradius=7.5)
data = section.select("Heave").times(100.0)

# %%
# Is the set of coefficients physical? Energy, reciprocity, causality, outliers.
report = data.check()
print(report)
report.plot()
plt.show()

# %%
# The order is chosen on held-out frequencies; the picture shows what was tried.
fit = rss.fit_radiation(data)
fit.plot_path()
plt.show()

# %%
# Export for OpenFAST (``.ss``), WEC-Sim (``.h5``) or MATLAB (``.mat``), and an audit of the file as somebody else's.
folder = Path(tempfile.mkdtemp())
fit.write(folder / "fit.json")
print(rss.audit(folder / "fit.json", data))
