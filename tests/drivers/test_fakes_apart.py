"""A driver for a real device never imports a fake, or a part of one."""

import re
from pathlib import Path

import drivers

ROOM = Path(drivers.__file__).parent
FAKES = {path.stem for path in ROOM.rglob("*fake*.py")}
IMPORT = re.compile(r"^\s*(?:from|import) (drivers\.\S+)(?: import (.+))?", re.MULTILINE)


def test_no_driver_imports_a_fake():
    assert "fake" in FAKES
    for path in ROOM.rglob("*.py"):
        if path.stem not in FAKES:
            for module, names in IMPORT.findall(path.read_text()):
                words = {*module.split("."), *re.findall(r"\w+", names)}
                assert not words & FAKES, f"{path} imports {module}"
