"""
For experimenters: what a decay test says about a model
=======================================================

A model and a record go in; which effect the model lacks, how large it is, and how far the gap shrinks come out.
"""

# %%
# The body of a wave tank. In practice ``rss.read_model("buoy.nc")``.
import numpy as np
from matplotlib import pyplot as plt

import radiation_ss as rss

section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.geomspace(0.3, 30.0, 80), depth=0.45, gyradius=0.07)
data = section.select("Heave").times(0.297)
model = rss.Model.from_hydro(data, rss.fit_radiation(data, 3))

# %%
# Two decay tests, simulated with a drag that the model does not have. In practice ``rss.read_record("decay.csv")``.
time = np.arange(0.0, 20.0, 0.02)
rng = np.random.default_rng(0)


def decay(release, name):
    """Return the record of a decay from a release [m]."""
    start = np.r_[np.zeros(model.fit.states), release, 0.0]
    motion = rss.simulate(model, (time, np.zeros((1, time.size))), [("quadratic_drag", "Heave", {"coefficient": 90.0})],
                          start=start)
    heave = motion.outputs[0] + 1e-4 * rng.standard_normal(time.size)
    return rss.Record(time, {"Heave": heave, "Heave_force": 0.0 * time}, kind="decay", name=name)


# %%
# The second record is withheld: no fit sees it, the gap is measured on it.
diagnosis = rss.diagnose(model, [decay(0.04, "40 mm")], withhold=[decay(0.05, "50 mm")])
print(diagnosis)
diagnosis.plot()
plt.show()

# %%
# The corrected model predicts the withheld record. ``diagnosis.save("gap")`` writes page, report and correction.
for cause in diagnosis.verdict.effects:
    print(cause.name, {name: f"{value:.3g} +- {std:.2g}" for name, (value, std) in cause.parameters.items()})
