"""Source by CasADi: a model with effects as an FMI 3.0 unit, or it and the live filter as C without a heap."""

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

from radiation_ss.arrays import FloatArray, positive, read_only
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.export.filter_source import filter_source
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.methods import accepting
from radiation_ss.simulation.equations import signals_of, state_equations, without_delays

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


@accepting(plant=lambda given: given if isinstance(given, DualEnKF) else as_model(given))
def write_c(plant: Model | DualEnKF, path: str | Path, effects: Iterable[Any] = (), *, dt: float | None = None) -> Path:
    """Write a plant, or a filter, as C source with a header beside it; the file's head says how to call it.

    Of a Model: `plant_rate` (t, x, u) -> (x', y), and with `dt` `plant_step` (t, x, u) -> (x after dt, y), by the
    classical Runge-Kutta method under constant u, in several steps where the fastest pole asks for them. Of a DualEnKF
    after `prepare` or `run`: `filter_step` (x, y) -> (x, force, its standard deviation), the Kalman filter at the
    parameters reached so far, at the record's interval, and beside it one for each direction in which the parameters
    are unsure: the standard deviation holds both. A sample that is NaN, or beyond the filter's gate, counts as missing:
    gain and standard deviation are then those of a filter without it, at the price of a step that takes longer, until
    they have settled again. x is zero before the first sample.

    Parameters
    ----------
    plant : Model, control.StateSpace, path or DualEnKF
    path : str or Path
        Ends in .c.
    effects : iterable
        With a Model, as in `simulate`; `diagnosis.corrected` for a diagnosed body; as in `write_fmu`.
    dt : float, optional
        Time step of `plant_step` [s].

    Raises
    ------
    InputError
        If the name does not end in .c, or the filter is not prepared or not the default one.
    SolverError
        If the filter's gain does not settle.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0)
    >>> rss.write_c(model, "heave.c", [("quadratic_drag", {"coefficient": 3.0})], dt=0.01).name
    'heave.c'
    """
    target = Path(path)
    if target.suffix != ".c" or not target.stem.isidentifier() or not target.parent.is_dir():
        raise InputError(f"{path}: a name of letters, digits and _ that ends in .c, in a folder that exists, is needed")
    if isinstance(plant, DualEnKF):
        functions, lists = filter_source(plant)
        dt = plant.interval
    else:
        functions, lists = _plant(plant, without_delays(plant, effects), dt)
    generator = ca.CodeGenerator(target.stem, {"with_header": True})
    for function in functions:
        generator.add(function)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        generator.generate()
        source, header = (Path(target.name).with_suffix(s).read_text(encoding="utf-8") for s in (".c", ".h"))
    target.write_text(_head(functions, lists, dt) + source, encoding="utf-8")
    target.with_suffix(".h").write_text(header, encoding="utf-8")
    return target


def _plant(model: Model, effects: tuple[Any, ...], dt: float | None,
           turn: float = 1.0) -> tuple[list[ca.Function], dict[str, list[str]]]:
    """Return the plant's functions, and names of its signals; `turn` [rad]: of the fastest pole a step (most 2.7)."""
    names, rate = ["t", "x", "u"], state_equations(model, effects)
    functions = [ca.Function("plant_rate", *_symbols(rate), names, ["rate", "y"])]
    if dt is not None:
        dt = positive(dt, "dt", "s")
        (t, x, u), (_, y) = _symbols(rate)
        parts = max(1, int(np.ceil(dt * np.abs(np.linalg.eigvals(model.matrices()[0])).max() / turn)))
        z = ca.MX.sym("z", x.numel() + 1)  # the states, and time
        flow = ca.Function("flow", [z, u], [ca.vertcat(rate(z[-1], z[:-1], u)[0], 1)])
        after = ca.simpleRK(flow, parts)(ca.vertcat(x, t), u, dt)[:-1]
        functions.append(ca.Function("plant_step", [t, x, u], [after, y], names, ["after", "y"]))
    states, inputs, outputs = signals_of(model, effects)
    return functions, {"x": states, "u": inputs, "y": outputs}


def _symbols(rate: ca.Function) -> tuple[list[Any], list[Any]]:
    arguments = [ca.MX.sym(f"i{k}", rate.sparsity_in(k)) for k in range(rate.n_in())]
    return arguments, list(rate(*arguments))


def _head(functions: list[ca.Function], lists: dict[str, list[str]], dt: float | None) -> str:
    """Return the comment that says how to call the functions, `dt` [s] apart."""
    lines = ["SI units. f(arg, res, iw, w, 0) returns 0: const double *arg[], double *res[], casadi_int iw[], double",
             "w[], of the sizes that f_work(&arg, &res, &iw, &w) gives. Input and output are different arrays."]
    for f in functions:
        into, out = (", ".join(f"{name}[{size}]" for name, size in zip(names, sizes)) for names, sizes in (
            (f.name_in(), [f.numel_in(k) for k in range(f.n_in())]),
            (f.name_out(), [f.numel_out(k) for k in range(f.n_out())])))
        lines.append(f"{f.name()}: {into} -> {out}")
    lines += [f"{name}: {', '.join(items)}" for name, items in lists.items()]
    if dt is not None:
        held = ", u constant between" if "u" in lists else ""
        lines.append(f"one call of {functions[-1].name()} every {dt!r} s{held}")
    return "/*\n" + "\n".join(f" * {line}" for line in lines) + "\n */\n"
