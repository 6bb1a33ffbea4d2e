"""The folders are the data flow: imports only go down it, and modules stay readable."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "radiation_ss"
ORDER = ["errors", "arrays", "style", "threads", "jit", "parallel", "atomic", "page", "hydro", "fit", "body", "waves",
         "records", "effects", "simulation", "inference", "filter", "identification", "gap", "diagnosis", "design",
         "export", "blind", "report", "cli"]
# Inside a stage the folders are the method's steps, too; a module beside them may use them all.
STEPS = {"gap": ["posterior", "tolerance", "which", "where", "how_far", "answer", "motion", "diagnose"]}
ENTRANCES = {PACKAGE / "__init__.py", PACKAGE / "__main__.py"}
MODULES = sorted(set(PACKAGE.rglob("*.py")) - ENTRANCES)


def imported_modules(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = set()
    for node in ast.walk(tree):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}:{node.lineno}: use absolute imports"
            names = [f"{node.module}.{a.name}" for a in node.names]
        found |= {name for name in names if name.startswith("radiation_ss.")}
    return found


def imported_stages(path: Path) -> set[str]:
    return {name.split(".")[1] for name in imported_modules(path)} & set(ORDER)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down_the_data_flow(path):
    stage = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    below = set(ORDER[: ORDER.index(stage) + 1])
    assert imported_stages(path) <= below


@pytest.mark.parametrize("path", [p for p in MODULES if p.relative_to(PACKAGE).parts[0] in STEPS
                                  and len(p.relative_to(PACKAGE).parts) > 2], ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down_the_steps_of_a_stage(path):
    stage, step = path.relative_to(PACKAGE).parts[:2]
    steps = STEPS[stage]
    above = set(steps[steps.index(step) + 1:])
    assert not {name.split(".")[2] for name in imported_modules(path)
                if name.startswith(f"radiation_ss.{stage}.")} & above


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
