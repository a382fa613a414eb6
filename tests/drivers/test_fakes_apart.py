"""A driver for a real device never imports a fake, or a part of one."""

import ast
from pathlib import Path

import pytest

import drivers

ROOM = Path(drivers.__file__).parent
MODULES = sorted(path for path in ROOM.rglob("*.py"))


def is_fake(module: str) -> bool:
    """Say whether the last part of a module's name says that it is a fake or a part of one."""
    return "fake" in module.rpartition(".")[2]


def imported(path: Path) -> set[str]:
    """Return the full names of all that a module imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports by a relative name"
            names |= {node.module or ""}
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def test_there_are_fakes_to_be_kept_apart():
    assert sum(is_fake(path.stem) for path in MODULES) >= 10


@pytest.mark.parametrize(
    "path", [p for p in MODULES if not is_fake(p.stem)], ids=lambda p: str(p.relative_to(ROOM))
)
def test_no_driver_imports_a_fake(path):
    found = {name for name in imported(path) if name.startswith("drivers.")}
    # only modules count: a function with such a name may ask for a fake by its entry point
    modules = {
        name for name in found if (ROOM.parent / Path(*name.split("."))).with_suffix(".py").exists()
    }
    assert not {name for name in modules if is_fake(name)}
