"""
For control engineers: radiation as a state-space model
=======================================================

A floating body with radiation is an ordinary ``ct.StateSpace``. Loops are designed as for any other plant.
"""

# %%
# Coefficients come from a file (``rss.read_hydro``) or, as here, from the shape of a section.
import control as ct
import numpy as np
from matplotlib import pyplot as plt

import radiation_ss as rss

section = rss.section_2d(rss.lewis_section(2.5, 2.5, np.pi / 4.0), np.linspace(0.1, 6.0, 60))
data = section.select("Heave").times(10.0)
data = data.replace(M=[[data.rho * 0.5 * np.pi * 2.5**2 * 10.0]])

# %%
# The fit is stable and passive by construction. Points are data, lines the fit.
fit = rss.fit_radiation(data, order=4)
print(fit)
fit.plot()
plt.show()

# %%
# Body and radiation together. The radiation states belong to the plant, so LQR feeds them back, too.
plant = rss.cummins(data, fit)
print(plant.input_labels, plant.output_labels, plant.state_labels)
force = 0.1 * float(data.C[0, 0])  # [N]: ten centimetres of static displacement
weights = np.diag([0.0] * fit.states + [100.0, 50.0])
K, _, poles = ct.lqr(plant, weights, [[1.0 / force**2]])

# %%
# Heave per wave excitation force, free and controlled.
closed = ct.ss(plant.A - plant.B @ K, plant.B, plant.C[:1], 0)
plt.figure()
ct.bode_plot([plant["heave", "heave_force"], closed], np.geomspace(0.1, 10.0, 300), label=["free", "LQR"],
             title="Heave per wave excitation force")
plt.show()
