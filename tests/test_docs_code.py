"""The documents say what is true: their code runs, also in docstrings, they name every public name, they build."""

import doctest
import importlib
import importlib.util
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

import radiation_ss

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
SPHINX = ("sphinx", "myst_parser", "furo", "sphinx_gallery")


def blocks(path):
    """Return (line, code) of the fenced python blocks."""
    text = path.read_text(encoding="utf-8")
    return [(text[:m.start(1)].count("\n"), m[1]) for m in BLOCK.finditer(text)]


@pytest.mark.parametrize("path", [p for p in DOCUMENTS if blocks(p)], ids=lambda p: p.stem)
def test_code_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    """The blocks of one document run in order, in a namespace and a folder of their own."""
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "__main__"}
    for line, code in blocks(path):
        # Line numbers of a traceback are those of the document.
        exec(compile("\n" * line + code, str(path), "exec"), namespace)
    plt.close("all")
    fits = [item for item in namespace.values() if isinstance(item, radiation_ss.RadiationFit)]
    # A document may bring a memory of its own (the paper's is not passive); what it fits has to be.
    fitted = "fit_radiation" in path.read_text(encoding="utf-8")
    assert not fitted or (fits and all(fit.stable and fit.passive for fit in fits))


def public(name):
    """Return a public object; `rss.body` is a package that is called, its function stands in `body.make`."""
    return getattr(importlib.import_module(f"radiation_ss.{radiation_ss._PUBLIC[name]}"), name)


@pytest.mark.parametrize("name", sorted({public(name).__module__ for name in radiation_ss._PUBLIC}))
def test_examples_in_docstrings_run(name, tmp_path, monkeypatch):
    """Those of every module that defines a public name; the examples of methods go on from that of their class."""
    monkeypatch.chdir(tmp_path)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    said: list[str] = []
    known: dict[str, dict] = {}
    for test in sorted(doctest.DocTestFinder().find(importlib.import_module(name)), key=lambda test: test.name):
        test.globs.update(known.get(test.name.rpartition(".")[0], {}))
        runner.run(test, out=said.append, clear_globs=False)
        known[test.name] = test.globs
    assert runner.failures == 0, "".join(said)
    plt.close("all")


def public_methods(name):
    """Return the public functions of a class that it defines itself, by name."""
    members = vars(public(name)).items() if inspect.isclass(public(name)) else ()
    bare = {key: getattr(member, "__func__", member) for key, member in members}
    return {f"{name}.{key}": member for key, member in bare.items() if key[0] != "_" and inspect.isfunction(member)}


def test_every_public_name_and_method_has_an_example():
    items = {name: public(name) for name in radiation_ss._PUBLIC}
    for name in radiation_ss._PUBLIC:
        items |= public_methods(name)
    assert not [name for name, item in items.items() if ">>>" not in (item.__doc__ or "")]


@pytest.mark.parametrize("name", sorted(radiation_ss._PUBLIC))
def test_every_public_name_has_a_docstring_in_numpydoc_form(name):
    """Parameters and what is raised are said where there are any."""
    item = getattr(radiation_ss, name)
    text = item.__doc__ or ""
    assert len(text.splitlines()[0]) > 20
    assert not re.search(r"^\s*:param", text, re.MULTILINE)
    signature = getattr(item, "__code__", None)
    if signature is not None and signature.co_argcount:
        assert "Parameters\n" in text, f"{name}: no Parameters section"


@pytest.mark.skipif(any(importlib.util.find_spec(name) is None for name in SPHINX),
                    reason="documentation tools absent: pip install .[docs]")
def test_documents_build_without_a_warning(tmp_path):
    """Links, mathematics, tables, the reference; the gallery's scripts are not run here."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-d", str(tmp_path / "trees"),
               str(ROOT / "docs"), str(tmp_path / "html")]
    quiet = {**os.environ, "MPLBACKEND": "Agg"}
    done = subprocess.run(command, capture_output=True, text=True, env=quiet, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    reference = (tmp_path / "html" / "generated" / "reference.html").read_text(encoding="utf-8")
    assert all(f"radiation_ss.{name}" in reference for name in radiation_ss._PUBLIC)
