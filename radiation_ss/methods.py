"""Methods of data classes whose work stands in a later module: pictures, files, checks.

A data class states the method, its arguments and its docstring, and returns `later(self, "plot", ...)`. LATER
names the function that does the work; it gets the object as its first argument. So data modules import no module that
imports them. To add one: a line in LATER and the function in its module (pictures, files of results: report/).
"""

from collections.abc import Callable, Mapping
from functools import wraps
from importlib import import_module
from inspect import signature
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

LATER = {
    "HydroData.__str__": "hydro.clean:text",
    "HydroData.with_A_inf": "hydro.clean:with_A_inf",
    "HydroData.rao": "hydro.clean:rao",
    "HydroData.at": "hydro.clean:at",
    "HydroData.check": "hydro.quality:check",
    "HydroData.clean": "hydro.clean:clean",
    "HydroData.to_xarray": "hydro.readers.capytaine:to_dataset",
    "HydroData.plot": "report.plots:plot_hydro",
    "QualityReport.plot": "report.plots:plot_quality",
    "RadiationFit.write": "fit.files:write_fit",
    "RadiationFit.plot": "report.plots:plot_fit",
    "RadiationFit.plot_path": "report.plots:plot_path",
    "RadiationFit.price_of_passivity": "fit.radiation:price_of_passivity",
    "Model.__str__": "body.dynamics:text",
    "Model.from_hydro": "body.dynamics:from_hydro",
    "Model.to_ss": "body.composite:cummins",
    "Model.plot": "report.plots:plot_model",
    "Model.write": "body.convert:write_model",
    "Record.__str__": "records.convert:text",
    "Record.plot": "report.plots:plot_record",
    "Record.from_pandas": "records.convert:from_pandas",
    "Record.to_pandas": "records.convert:to_pandas",
    "Record.to_xarray": "records.convert:to_xarray",
    "Identification.__str__": "report.identification_files:text",
    "Identification.to_dict": "report.identification_files:to_dict",
    "Identification.plot": "report.identification_files:coefficients",
    "Identification.save": "report.identification_files:save",
    "TestPlan.__str__": "report.plan_plot:text",
    "TestPlan.plot": "report.plan_plot:plot_plan",
    "TestPlan.save": "report.plan_plot:save",
    "Diagnosis.plot": "report.diagnosis_page:overview",
    "Diagnosis.sentence": "report.diagnosis_page:sentence",
    "Diagnosis.save": "report.diagnosis_page:save",
}


def later(item: Any, method: str, *arguments: Any, **options: Any) -> Any:
    """Do the work of a method of `item`."""
    return function_of(type(item), method)(item, *arguments, **options)


def function_of(kind: type, method: str) -> Callable[..., Any]:
    """Return the function that LATER names for a method of a class, or of the nearest base of it."""
    for base in kind.__mro__:
        if place := LATER.get(f"{base.__name__}.{method}"):
            module, _, name = place.partition(":")
            return getattr(import_module(f"radiation_ss.{module}"), name)
    raise LookupError(f"radiation_ss.methods.LATER has no line for {kind.__name__}.{method}")


def door(room: str, names: Mapping[str, str]) -> tuple[Callable[[str], Any], list[str]]:
    """Return `__getattr__` and `__all__` of a room: its names, by the module that each is loaded from on first use."""
    places = {name: f"{room}.{module}" for module, some in names.items() for name in some.split()}

    def load(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {room!r} has no attribute {name!r}")
        return getattr(import_module(places[name]), name)

    return load, list(places)


def accepting(**forms: Callable[..., Any]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that makes of the named arguments what the function works on: of a file its content.

    A form with a parameter `model` gets the function's model, which stands before it.
    """
    by_model = {name for name, form in forms.items() if "model" in signature(form).parameters}

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        parameters = signature(function)

        @wraps(function)
        def opened(*args: P.args, **options: P.kwargs) -> R:
            bound = parameters.bind(*args, **options)
            for name, form in forms.items():
                if name in bound.arguments:
                    known = {"model": bound.arguments["model"]} if name in by_model else {}
                    bound.arguments[name] = form(bound.arguments[name], **known)
            return function(*bound.args, **bound.kwargs)

        return opened

    return decorate


class Brief:
    """A result that a prompt shows as the first ten lines of its text; its dataclass says `repr=False`."""

    def __repr__(self) -> str:
        from radiation_ss.page import brief

        return brief(str(self))


class Shown(Brief):
    """A result that notebooks show as its text and, where it can be drawn, its picture."""

    def _repr_html_(self) -> str:
        from radiation_ss.page import fragment

        return fragment(self)
