"""Draw the pictures of README and guide by their own commands.

python docs/pictures.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import radiation_ss as rss
from radiation_ss.cli import main

IMAGES = Path(__file__).parent / "images"
# Few enough to be read at the width of a page.
EFFECTS = ["quadratic_drag", "coulomb_friction", "linear_damping", "cubic_stiffness", "linear_stiffness",
           "slack_mooring", "constant_force", "sensor_bias", "excitation_gain"]


def draw() -> None:
    """Run the demo, then diagnose, identify and plan on the files it leaves."""
    IMAGES.mkdir(exist_ok=True)
    with TemporaryDirectory() as place:
        demo = Path(place) / "demo"
        assert main(["demo", "--out", str(demo)]) == 0
        model = rss.read_model(demo / "tank.nc", order=3)
        records = [rss.read_record(demo / f"{name}.csv") for name in ("decay_40mm", "waves_40mm")]
        unseen = rss.read_record(demo / "waves_50mm_unseen.csv")
        found = rss.diagnose(model, records, withhold=[unseen])
        found.plot().savefig(IMAGES / "diagnose.svg")
        body = rss.identify(rss.read_model(demo / "tank.nc", order=6), [rss.read_record(demo / "waves_30s.csv")],
                            method="prediction-error")
        body.plot().savefig(IMAGES / "identify.svg")
        plan = rss.plan_tests(model, 0.04, tests=("decay", "waves with force"), effects=EFFECTS)
        plan.plot().savefig(IMAGES / "plan.svg")


if __name__ == "__main__":
    draw()
