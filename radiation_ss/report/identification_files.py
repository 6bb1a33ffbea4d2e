"""Files of an identification: identify.json, one CSV of the force for each record, pictures."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from radiation_ss.atomic import folder_written_whole, write_whole, written_whole
from radiation_ss.identification.result import ForceEstimate, Identification
from radiation_ss.report.identification_plot import coefficients, force

LONGEST_NAME = 80       # characters of a record's name in a file name


def save(result: Identification, folder: str | Path) -> Path:
    """Write identify.json, force_<record>.csv for each estimated force, and pictures; return the folder."""
    from matplotlib import pyplot as plt

    with folder_written_whole(folder) as place:
        stems = file_stems(result.force)
        for record, estimate in result.force.items():
            write_force(place / f"{stems[record]}.csv", result.dofs, estimate)
        text = json.dumps(result.to_dict({record: f"{stem}.csv" for record, stem in stems.items()}), indent=1,
                          allow_nan=False, ensure_ascii=False)
        write_whole(place / "identify.json", text + "\n")
        figures = {"coefficients": coefficients(result)}
        figures |= {stems[record]: force(result.dofs, estimate, record) for record, estimate in result.force.items()
                    if np.isfinite(estimate.mean).any()}
        for stem, figure in figures.items():
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "Glyph .* missing")      # a title in a script that the font lacks
                figure.savefig(place / f"{stem}.png")
            plt.close(figure)
    return Path(folder)


def file_stems(records: Iterable[str]) -> dict[str, str]:
    """Return a file name without ending for each record's force: letters of any script are kept, names differ."""
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for record in records:
        stem = "force_" + re.sub(r"[^\w.-]+", "_", record)[:LONGEST_NAME]
        name, number = stem, 2
        while name.casefold() in taken:
            name, number = f"{stem}_{number}", number + 1
        taken.add(name.casefold())
        stems[record] = name
    return stems


def write_force(path: Path, dofs: tuple[str, ...], estimate: ForceEstimate) -> None:
    """Write time and, for each degree of freedom, the force with its band."""
    header, columns = ["time"], [estimate.time]
    for j, dof in enumerate(dofs):
        header += [f"{dof}_force", f"{dof}_force_lower", f"{dof}_force_upper"]
        columns += [estimate.mean[j], estimate.lower[j], estimate.upper[j]]
    with written_whole(path) as beside:
        np.savetxt(beside, np.stack(columns, axis=1), fmt="%.8g", delimiter=",", header=",".join(header), comments="")
