"""Sphinx configuration: MyST guides, API from docstrings, examples as a gallery.

    python -m sphinx -W --keep-going docs docs/_build/html
"""

import sys
import warnings
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import radiation_ss  # noqa: E402

project = "radiation_ss"
author = "the radiation_ss developers"
copyright = f"2026, {author}"
release = version = radiation_ss.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
exclude_patterns = ["_build", "generated/gallery/**/*.ipynb"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
# Documents point at files of the repository (benchmarks, examples) that are no pages.
suppress_warnings = ["myst.xref_missing", "config.cache"]

autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"radiation_ss {release}"
templates_path = ["_templates"]

# Sphinx's dependencies warn about each other's future; that is no fault of these documents.
warnings.filterwarnings("ignore", category=DeprecationWarning)
warnings.filterwarnings("ignore", category=PendingDeprecationWarning)

if any((ROOT / "examples").glob("[0-9]*.py")):
    extensions.append("sphinx_gallery.gen_gallery")
    sphinx_gallery_conf = {
        "examples_dirs": str(ROOT / "examples"),
        "gallery_dirs": "auto_examples",
        "filename_pattern": r"/\d\d_",  # numbered stories run in seconds; examples/paper is shown, not run
        "ignore_pattern": r"(__init__|_common|paper)",
        "within_subsection_order": "FileNameSortKey",
        "remove_config_comments": True,
        "download_all_examples": False,
        "show_memory": False,
    }
