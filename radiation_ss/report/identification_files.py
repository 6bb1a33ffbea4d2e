"""Files of an identification: identify.json, a CSV file for each estimated force, pictures."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.report.identification_plot import coefficients, force

if TYPE_CHECKING:
    from radiation_ss.identification.result import ForceEstimate, Identification


def save(result: Identification, folder: str | Path) -> Path:
    """Write identify.json, force_<record>.csv for each estimated force, and pictures; return the folder."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = {record: f"force_{re.sub(r'[^A-Za-z0-9_.-]+', '_', record)}.csv" for record in result.force}
    for record, estimate in result.force.items():
        write_force(folder / files[record], result.dofs, estimate)
    text = json.dumps(result.to_dict(files), indent=1, allow_nan=False)
    (folder / "identify.json").write_text(text + "\n", encoding="utf-8")
    save_pictures(result, folder, files)
    return folder


def write_force(path: Path, dofs: tuple[str, ...], estimate: ForceEstimate) -> None:
    """Write time, and of each degree of freedom the force with the ends of its band."""
    header, columns = ["time"], [estimate.time]
    for j, dof in enumerate(dofs):
        header += [f"{dof}_force", f"{dof}_force_lower", f"{dof}_force_upper"]
        columns += [estimate.mean[j], estimate.lower[j], estimate.upper[j]]
    np.savetxt(path, np.stack(columns, axis=1), fmt="%.8g", delimiter=",", header=",".join(header), comments="")


def save_pictures(result: Identification, folder: Path, files: dict[str, str]) -> None:
    """Write coefficients.png and, beside each force CSV file, its picture."""
    from matplotlib import pyplot as plt

    figures = {"coefficients.png": coefficients(result)}
    for record, estimate in result.force.items():
        if np.isfinite(estimate.mean).any():
            figures[files[record].removesuffix(".csv") + ".png"] = force(result.dofs, estimate, record)
    for name, figure in figures.items():
        figure.savefig(folder / name)
        plt.close(figure)
