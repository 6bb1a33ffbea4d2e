"""Methods of data classes whose work stands in a later module: pictures, files, checks.

A data class states the method, its arguments and its docstring, and returns `later("report.plots:plot_fit", self)`
with the arguments. So data modules import no module that imports them.
"""

from collections.abc import Callable, Mapping
from functools import wraps
from importlib import import_module
from inspect import signature
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def later(place: str, *arguments: Any, **options: Any) -> Any:
    """Do the work of a method in the function that stands at a place, "report.plots:plot_fit"."""
    module, _, name = place.partition(":")
    return getattr(import_module(f"radiation_ss.{module}"), name)(*arguments, **options)


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
            try:
                bound = parameters.bind(*args, **options)
            except TypeError as error:
                raise TypeError(f"{function.__name__}() {error}") from None
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
