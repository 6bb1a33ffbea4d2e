"""Sphinx configuration: MyST guides, the reference from docstrings, examples as a gallery.

    python -m sphinx -W --keep-going docs docs/_build/html

The gallery shows the examples; RADIATION_SS_RUN_EXAMPLES=1 runs them too, for their pictures, as CI does.
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import radiation_ss  # noqa: E402

project = "radiation_ss"
author = "the radiation_ss developers"
copyright = f"2026, {author}"
release = version = radiation_ss.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon",
              "sphinx.ext.mathjax"]
exclude_patterns = ["_build", "**sg_execution_times.rst"]
smartquotes = False  # options of commands keep their two hyphens
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
# Documents name files of the repository that are no pages.
suppress_warnings = ["myst.xref_missing", "config.cache"]

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = True
napoleon_google_docstring = False

html_theme = "furo"
html_title = f"radiation_ss {release}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]

GALLERY = any((ROOT / "examples").glob("[0-9]*.py"))
if GALLERY:
    from sphinx_gallery.scrapers import matplotlib_scraper
    from sphinx_gallery.sorting import ExplicitOrder

    def vector_pictures(*block, **options):
        return matplotlib_scraper(*block, format="svg", **options)

    extensions.append("sphinx_gallery.gen_gallery")
    sphinx_gallery_conf = {
        "examples_dirs": "../examples",
        "gallery_dirs": "auto_examples",
        "filename_pattern": r"examples/(users/|vugts/)?\d\d_",  # measured campaigns take minutes
        "ignore_pattern": r"(^|/)(?!\d\d_)[^/]*\.py$",
        "subsection_order": ExplicitOrder(["../examples/users", "../examples/vugts", "../examples/measured", "*"]),
        "within_subsection_order": "FileNameSortKey",
        "default_thumb_file": str(ROOT / "docs" / "images" / "diagnose.svg"),  # of measured campaigns, which do not run
        "plot_gallery": os.environ.get("RADIATION_SS_RUN_EXAMPLES", "0") == "1",
        "download_all_examples": False,
        "show_memory": False,
        "image_scrapers": (vector_pictures,),
    }

# The rooms of the package whose public names stand under one heading, in the order of the work.
HEADINGS = {"Hydrodynamic data": ("hydro",), "Radiation models": ("fit", "export"), "The model of the body": ("body",),
            "Waves": ("waves",), "Records, effects and simulation": ("records", "effects", "simulation"),
            "Identification": ("filter", "identification"), "Diagnosis": ("gap", "diagnosis"),
            "Design of tests": ("design",), "Errors": ("errors",)}

# What public functions return, and modules whose functions are named in the guides.
BESIDE = {"hydro": ("hydro.findings.QualityReport", "hydro.findings.Finding", "hydro.clean.clean",
                    "hydro.section.solver.solve_section", "hydro.transforms.kernel", "hydro.transforms.estimate_A_inf"),
          "fit": ("fit.certificate.Certificate", "fit.audit.Audit"),
          "simulation": ("simulation.rollout.Rollout",),
          "diagnosis": ("diagnosis.shares.Budget", "diagnosis.rules.Rules")}


def write_reference(app: object, config: object) -> None:
    """Write the list of public names by stage, from which autosummary makes the pages."""
    lines = ["# Reference", "", "Everything public is an attribute of `radiation_ss`. Modules are loaded on first use."]
    for heading, rooms in HEADINGS.items():
        names = [name for name, module in radiation_ss._PUBLIC.items() if module.split(".")[0] in rooms]
        names += [name for room in rooms for name in BESIDE.get(room, ())]
        if names:
            lines += ["", f"## {heading}", "", "```{eval-rst}", ".. autosummary::", "   :toctree: .",
                      "   :nosignatures:", "", *(f"   radiation_ss.{name}" for name in names), "```"]
    folder = ROOT / "docs" / "generated"
    folder.mkdir(exist_ok=True)
    (folder / "reference.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def escape_bars(app: object, what: str, name: str, item: object, options: object, lines: list[str]) -> None:
    """Keep |x| in plain docstrings from being taken for a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app: object) -> None:
    """Register what is written and changed on the way."""
    app.connect("config-inited", write_reference)  # type: ignore[attr-defined]
    app.connect("autodoc-process-docstring", escape_bars)  # type: ignore[attr-defined]
