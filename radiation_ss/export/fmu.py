"""A model with effects as an FMI 3.0 model-exchange unit, its source written by CasADi."""

import contextlib
import platform
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.methods import accepting
from radiation_ss.simulation.native import signals_of, state_equations, without_delays

MACHINES = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
LIBRARIES = {"Linux": ("linux", ".so"), "Darwin": ("darwin", ".dylib"), "Windows": ("windows", ".dll")}


@accepting(model=as_model)
def write_fmu(model: Model, path: str | Path, effects: Iterable[Any] = (), *, start: FloatArray | None = None,
              headers: str | Path | None = None) -> Path:
    """Write the model with effects as an FMI 3.0 model-exchange unit.

    Inputs, outputs and states are those of `simulation.nonlinear_system`; states are called `state.<name>`,
    and their start values can be set. The unit holds the equations as C source, which an importing program can compile,
    and where there are `headers` and a C compiler a library for this machine, which any program runs.

    Parameters
    ----------
    model : Model, control.StateSpace or path
    path : str or Path
        Ends in .fmu.
    effects : iterable
        As in `simulate`; `diagnosis.corrected` for a diagnosed body. Delays of force and sensors, and the
        drift of a clock, are left out; a warning names them.
    start : ndarray, shape (states,), optional
        At time zero; zero if absent.
    headers : str or Path, optional
        Folder of the FMI standard's header files, fmi3Functions.h among them: a C compiler, `cc`, is then called.
        If not given those of FMPy (extra `fmu`).

    Raises
    ------
    InputError
        If the name does not end in .fmu, or the folder has no headers.
    SolverError
        If the compiler fails.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0)
    >>> rss.write_fmu(model, "heave.fmu", [("quadratic_drag", {"coefficient": 3.0})]).name
    'heave.fmu'
    """
    target = Path(path)
    if target.suffix != ".fmu" or not target.parent.is_dir():
        raise InputError(f"{path}: a name that ends in .fmu, in a folder that exists, is needed")
    headers = headers or _fmpy_headers()
    if headers is not None and not (Path(headers) / "fmi3Functions.h").is_file():
        raise InputError(f"{headers}: no fmi3Functions.h; the FMI standard's headers are needed (FMPy has them)")
    with tempfile.TemporaryDirectory() as folder:
        with contextlib.chdir(folder):
            # CasADi 3.7 has no such options and returns names without their places.
            options = {"no_warning": True, "with_serialization": False} if hasattr(ca.DaeBuilder, "pack_fmu") else {}
            made = described(model, without_delays(model, effects), start).export_fmu(options)
        description = Path(folder) / "modelDescription.xml"
        files = {Path(folder) / name: f"sources/{name}" for name in made} | {description: description.name}
        _tidy(description, model.name)
        for source in Path(folder).glob("*.c"):  # FMPy's method of Euler asks for event indicators even where none is
            text = source.read_text()
            source.write_text(text.replace("  // No zero crossings\n  return fmi3Fatal;", "  return fmi3OK;"))
        if headers is not None:
            library = _compile([file for file in files if file.suffix == ".c"], Path(headers).resolve())
            files[library] = f"binaries/{library.parent.name}/{library.name}"
        whole = Path(folder) / "whole.fmu"
        with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
            for file, place in files.items():
                archive.write(file, place)
        shutil.copy(whole, target)
    return target


def _fmpy_headers() -> Path | None:
    """Return FMPy's folder of headers, None without it or without a compiler."""
    found = find_spec("fmpy")
    return None if found is None or not found.origin or not shutil.which("cc") else Path(found.origin).parent / "c-code"


def described(model: Model, effects: Iterable[Any], start: FloatArray | None = None) -> ca.DaeBuilder:
    """Return the model with effects as a CasADi DaeBuilder with scalar variables."""
    states, inputs, outputs = signals_of(model, effects)
    n = len(states)
    values = read_only(np.zeros(n) if start is None else start, f"states {', '.join(states)}; start", (n,))
    builder = ca.DaeBuilder("radiation_ss")
    time = builder.add("time", "independent")
    x = [builder.add(f"state.{name}") for name in states]
    u = [builder.add(name, "input") for name in inputs]
    rate, y = state_equations(model, effects)(time, ca.vertcat(*x), ca.vertcat(*u))
    for symbol, name, expression, value in zip(x, states, ca.vertsplit(rate), values):
        builder.eq(builder.der(symbol), expression)
        builder.set_initial(f"state.{name}", "exact")
        builder.set_start(f"state.{name}", float(value))
    for name, expression in zip(outputs, ca.vertsplit(y)):
        builder.eq(builder.add(name, "output"), expression)
    return builder


def _tidy(description: Path, name: str) -> None:
    """Name the model as the user does, and drop intermediate variables, whose names FMI does not allow."""
    tree = ET.parse(description)
    tree.getroot().set("modelName", name)
    tree.getroot().set("variableNamingConvention", "flat")
    for variables in tree.getroot().iter("ModelVariables"):
        for variable in [v for v in variables if v.get("name", "").startswith("__assign__")]:
            variables.remove(variable)
    # An output of CasADi 3.7 depends on nothing: no list says on everything.
    for element in tree.getroot().iter():
        if element.tag in ("Output", "InitialUnknown") and element.get("dependencies") == "":
            del element.attrib["dependencies"]
    tree.write(description, encoding="UTF-8", xml_declaration=True)


def _compile(sources: list[Path], headers: Path) -> Path:
    """Return the shared library in a folder of FMI 3's name for this machine."""
    system, suffix = LIBRARIES[platform.system()]
    folder = sources[0].parent / f"{MACHINES.get(platform.machine().lower(), platform.machine())}-{system}"
    folder.mkdir()
    library = folder / f"radiation_ss{suffix}"
    command = ["cc", "-O2", "-shared", "-fPIC", f"-I{headers}", *map(str, sources), "-lm", "-o", str(library)]
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        raise SolverError(f"write_fmu: no C compiler `cc` ({error.strerror}); leave out headers=") from None
    if done.returncode:
        raise SolverError(f"write_fmu: cc failed: {done.stderr.strip().splitlines()[0]}")
    return library
