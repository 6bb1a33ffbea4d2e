"""The diagnosing process of a blind run: python -m radiation_ss.gap.blind.worker FOLDER."""

import sys
from pathlib import Path

from radiation_ss.gap.blind.runner import answer_all

if __name__ == "__main__":
    answer_all(Path(sys.argv[1]))
