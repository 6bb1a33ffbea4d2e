"""The folders are the data flow: imports only go down it, and modules stay readable."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "radiation_ss"
ORDER = ["errors", "arrays", "style", "page", "hydro", "fit", "plant", "waves", "simulation", "filter", "gap",
         "report", "cli"]
ENTRANCES = {PACKAGE / "__init__.py", PACKAGE / "__main__.py"}
MODULES = sorted(set(PACKAGE.rglob("*.py")) - ENTRANCES)


def imported_stages(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = set()
    for node in ast.walk(tree):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}:{node.lineno}: use absolute imports"
            names = [f"{node.module}.{a.name}" for a in node.names]
        found |= {name.split(".")[1] for name in names if name.startswith("radiation_ss.")}
    return found & set(ORDER)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down_the_data_flow(path):
    stage = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    below = set(ORDER[: ORDER.index(stage) + 1])
    assert imported_stages(path) <= below


def test_unknown_name_is_an_attribute_error():
    import radiation_ss as rss

    with pytest.raises(AttributeError, match="no attribute"):
        rss.no_such_name  # noqa: B018


def test_type_checkers_see_the_public_names():
    import radiation_ss as rss

    stub = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    seen = {alias.asname: f"radiation_ss.{rss._PUBLIC.get(alias.name)}" == node.module
            for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == dict.fromkeys(rss._PUBLIC, True)
