"""The folders are the workflow: imports only go down it, never in a circle; data modules know nothing of reports."""

import ast
import importlib
import re
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

PACKAGE = Path(__file__).parents[1] / "radiation_ss"
ORDER = ["errors", "arrays", "units", "style", "threads", "jit", "parallel", "atomic", "reading", "page", "methods",
         "hydro", "fit", "body", "waves", "records", "effects", "simulation", "inference", "filter", "identification",
         "diagnosis", "design", "export", "blind", "report", "cli"]
ENTRANCES = {PACKAGE / "__init__.py", PACKAGE / "__main__.py"}
MODULES = sorted(set(PACKAGE.rglob("*.py")) - ENTRANCES)


@cache
def imports(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """Return all imports of a module, also inside functions and where only type checkers look."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]


def imported_modules(path: Path) -> set[str]:
    found = set()
    for node in imports(path):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}:{node.lineno}: use absolute imports"
            names = [f"{node.module}.{a.name}" for a in node.names]
        found |= {name for name in names if name.startswith("radiation_ss.")}
    return found


def imported_stages(path: Path) -> set[str]:
    return {name.split(".")[1] for name in imported_modules(path)} & set(ORDER)


def name_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(path: Path, modules: set[str]) -> set[str]:
    """Return modules of the package that a module imports."""
    found = set()
    for node in imports(path):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        if isinstance(node, ast.ImportFrom):
            full = {f"{node.module}.{alias.name}" for alias in node.names}
            found.update(name if name in modules else node.module for name in full)
    return found & modules


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Return the strongly connected components of more than one module (each module's own reach, twice)."""
    def reach(start: str) -> set[str]:
        seen, waiting = set(), [start]
        while waiting:
            for follower in graph[waiting.pop()] - seen:
                seen.add(follower)
                waiting.append(follower)
        return seen

    reached = {name: reach(name) for name in graph}
    found = {frozenset(other for other in reached[name] if name in reached[other]) for name in graph}
    return [set(component) for component in found if component]


def test_circles_are_found():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set(), "e": {"e"}}
    assert sorted(map(sorted, circles(graph))) == [["a", "b", "c"], ["e"]]


def test_no_circle_of_imports():
    paths = {name_of(path): path for path in MODULES}
    found = circles({name: imports_of(path, set(paths)) for name, path in paths.items()})
    assert not found


def test_only_pages_and_the_command_line_import_reports():
    above = {"report", "cli"}
    for path in MODULES:
        if path.relative_to(PACKAGE).parts[0].removesuffix(".py") not in above:
            assert not imported_stages(path) & above, path


PLACES = sorted(set(re.findall(r'later\("([^"]+)"', "".join(path.read_text(encoding="utf-8") for path in MODULES))))


@pytest.mark.parametrize("place", PLACES)
def test_functions_that_do_the_work_of_methods_are_there(place):
    module, _, function = place.partition(":")
    assert callable(getattr(importlib.import_module(f"radiation_ss.{module}"), function))


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down_the_data_flow(path):
    stage = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    below = set(ORDER[: ORDER.index(stage) + 1])
    assert imported_stages(path) <= below


ROOMS = sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py"))


@pytest.mark.parametrize("room", ["", *ROOMS])
def test_every_name_at_a_door_is_there(room):
    found = importlib.import_module(f"radiation_ss.{room}".rstrip("."))
    names = [name for name in getattr(found, "__all__", ()) if found.__name__ != "radiation_ss" or name != "body"]
    assert not [name for name in names if isinstance(getattr(found, name), ModuleType)]
    with pytest.raises(AttributeError, match="no attribute"):
        found.no_such_name  # noqa: B018


@pytest.mark.parametrize("path", sorted(Path(__file__).parent.rglob("*.py")), ids=lambda p: p.name)
def test_tests_speak_to_public_names_and_to_the_doors_of_rooms(path):
    modules = {name_of(other) for other in MODULES if name_of(other).count(".") > 1}
    assert not imports_of(path, modules)


def test_type_checkers_see_the_public_names():
    import radiation_ss as rss

    stub = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    seen = {alias.asname: f"radiation_ss.{rss._PUBLIC.get(alias.name)}" == node.module
            for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == dict.fromkeys(rss._PUBLIC, True)
