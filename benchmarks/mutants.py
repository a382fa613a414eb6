"""Damage the wire formats of the drivers on purpose and see whether their tests notice.

    python -m benchmarks.mutants [driver ...] [--list]

A driver and its fake share `protocol.py`: a byte that both get wrong passes every test that runs
the one against the other. Only bytes written down from a source, and foreign peers, notice it.
So each `drivers/*/protocol.py` is changed in one place at a time, in a copy of the project, and
the driver's tests are run on the copy. A mutant they fail on is killed. Mutations are made by
rules, not by hand: byte orders, named codes, bits and shifts in functions, the order of tables.

Exit code 0 when every mutant is killed but those in `UNOBSERVABLE`, each with its reason.
"""

import argparse
import ast
import multiprocessing
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeGuard

# loaded once for all mutants; none of it is this project's
import can  # noqa: F401
import canopen  # noqa: F401
import hypothesis.strategies  # noqa: F401
import numpy  # noqa: F401
import pymodbus.server  # noqa: F401
import pytest

ROOT = Path(__file__).parents[1]
LONGEST_S = 300.0
FORMAT_STARTS = ("<", ">")

HELD_TO_ANOTHER = "teensy"
"""Its bytes are compared with a second implementation, the firmware's, by other tests."""

UNOBSERVABLE = {
    ("moteus", "LONGEST_LINE = 256 -> LONGEST_LINE = 257"): "a bound of this project, not a format",
    ("moteus", "PREPARING = (2, 3, 4) -> PREPARING = (3, 2, 4)"): "a set: its order has no meaning",
    ("moteus", "HOST << 8 -> HOST << 9"): "the host's identifier is 0",
    ("usb520", "LONGEST_LINE = 64 -> LONGEST_LINE = 65"): "a bound of this project, not a format",
}
"""By driver and mutation: why no source can settle it."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of one file.

    Attributes:
        what: The change, in a few words.
        source: The whole changed file.
    """

    driver: str
    what: str
    source: str


def mutants_of(driver: str, text: str) -> Iterator[Mutant]:
    """Yield the mutants of a protocol's source, one for each place a rule fits."""
    tree = ast.parse(text)
    documentation = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for statement in tree.body:
        inside = isinstance(statement, ast.FunctionDef)
        for node in ast.walk(statement):
            if id(node) in documentation:
                continue
            if isinstance(node, ast.expr | ast.stmt):
                old = ast.unparse(node)
                for new in _changes(node, inside):
                    what = f"line {node.lineno}: {old} -> {new}"
                    yield Mutant(driver, what, _replaced(text, node, new))


def _changes(node: ast.AST, inside: bool) -> Iterator[str]:
    """Yield the texts that a node is replaced by."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        if node.value[:1] in FORMAT_STARTS and len(node.value) > 1:
            other = FORMAT_STARTS[1 - FORMAT_STARTS.index(node.value[0])]
            yield repr(other + node.value[1:])
        elif node.value in ("little", "big"):
            yield repr("big" if node.value == "little" else "little")
    elif isinstance(node, ast.Assign) and not inside:
        yield from _of_a_constant(node)
    elif isinstance(node, ast.BinOp) and inside:
        yield from _of_an_operation(node)
    elif inside and _is_packing(node):
        yield _with(node, "args", _swapped(node.args))


def _is_packing(node: ast.AST) -> TypeGuard[ast.Call]:
    return (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == "pack"
        and len(node.args) > 1
    )


def _of_a_constant(node: ast.Assign) -> Iterator[str]:
    """Change a named code, or the order of named codes and of a table."""
    value = node.value
    if isinstance(value, ast.Constant) and isinstance(value.value, int | bytes):
        yield _with(node, "value", ast.Constant(_other(value.value)))
    elif isinstance(value, ast.Tuple) and len(value.elts) > 1:
        if all(isinstance(element, ast.Constant) for element in value.elts):
            yield _with(node, "value", ast.Tuple(_swapped(value.elts)))
        for constant in ast.walk(value):
            if isinstance(constant, ast.Constant) and isinstance(constant.value, int | bytes):
                kept = constant.value
                constant.value = _other(kept)
                yield ast.unparse(node)
                constant.value = kept
    elif isinstance(value, ast.Dict) and len(value.keys) > 1:
        swapped = ast.Dict(value.keys, _swapped(value.values))
        yield _with(node, "value", swapped)


def _of_an_operation(node: ast.BinOp) -> Iterator[str]:
    """Change the number a value is shifted or masked by."""
    if not isinstance(node.op, ast.LShift | ast.RShift | ast.BitAnd | ast.BitOr):
        return
    if isinstance(node.right, ast.Constant) and isinstance(node.right.value, int):
        yield _with(node, "right", ast.Constant(node.right.value + 1))


def _other(value: int | bytes) -> int | bytes:
    return bytes([value[0] ^ 1]) + value[1:] if isinstance(value, bytes) else value + 1


def _swapped(nodes: list[ast.expr]) -> list[ast.expr]:
    return [nodes[1], nodes[0], *nodes[2:]]


def _with(node: ast.AST, field: str, value: object) -> str:
    """Return the text of a node with one field changed."""
    fields = {name: getattr(node, name) for name in node._fields}
    copy = type(node)(**fields | {field: value})
    return ast.unparse(ast.copy_location(ast.fix_missing_locations(copy), node))


def _replaced(text: str, node: ast.expr | ast.stmt, new: str) -> str:
    """Return a source with the text of one node replaced."""
    lines = text.encode().splitlines(keepends=True)
    first = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    last = sum(map(len, lines[: node.end_lineno - 1])) + node.end_col_offset
    whole = b"".join(lines)
    return (whole[:first] + new.encode() + whole[last:]).decode()


def is_killed(mutant: Mutant, copy: Path) -> bool:
    """Return whether the driver's tests fail on a copy of the project with the mutant in it."""
    target = copy / "drivers" / mutant.driver / "protocol.py"
    original = target.read_text()
    target.write_text(mutant.source)
    child = multiprocessing.get_context("fork").Process(
        target=_run_tests, args=(copy, tests_of(mutant.driver))
    )
    child.start()
    child.join(LONGEST_S)
    if child.is_alive():
        child.kill()
        child.join()
    target.write_text(original)
    return child.exitcode != 0


def _run_tests(copy: Path, tests: list[Path]) -> None:
    """Run tests on a copy of the project, in a process whose libraries are loaded already."""
    os.chdir(copy)
    sys.path.insert(0, str(copy))
    sys.dont_write_bytecode = True  # two mutants of one size and second look alike to a cache
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
        options = [
            "-q",
            "-x",
            "-p",
            "no:cacheprovider",
            "-n",
            "0",
            "--assert=plain",
            f"--rootdir={copy}",
        ]
        os._exit(int(pytest.main([*options, *map(str, tests)])))


def tests_of(driver: str) -> list[Path]:
    """Return the test files of a driver, seen from the project's folder."""
    folder = Path("tests/drivers")
    names = sorted((ROOT / folder).glob(f"test_{driver}*.py"))
    return [folder / path.name for path in names]


def copied(to: Path) -> Path:
    """Copy what the drivers' tests need and return the folder."""
    for name in ("drivers", "tests", "firmware"):
        ignore = shutil.ignore_patterns("__pycache__", "build")
        shutil.copytree(ROOT / name, to / name, ignore=ignore)
    shutil.copy(ROOT / "pyproject.toml", to)
    for name in ("rig", "estimation", "calibration"):
        (to / name).symlink_to(ROOT / name)
    return to


def main() -> int:
    """Make the mutants, run them, and print a line for each that survives."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("drivers", nargs="*", help="folders under drivers/; all when none is given")
    parser.add_argument("--list", action="store_true", help="print the mutants and run none")
    chosen = parser.parse_args()
    found = {path.parent.name: path for path in sorted(ROOT.glob("drivers/*/protocol.py"))}
    names = chosen.drivers or [name for name in found if name != HELD_TO_ANOTHER]
    mutants = [m for name in names for m in mutants_of(name, found[name].read_text())]
    if chosen.list:
        for mutant in mutants:
            print(f"{mutant.driver:12} {mutant.what}")  # noqa: T201
        return 0
    survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = copied(Path(folder))
        for name in names:
            if is_killed(Mutant(name, "unchanged", found[name].read_text()), copy):
                raise SystemExit(f"the tests of {name} fail without a mutant")
        for number, mutant in enumerate(mutants, 1):
            reason = UNOBSERVABLE.get((mutant.driver, mutant.what.partition(": ")[2]))
            verdict = "unobservable" if reason else None
            if verdict is None:
                killed = is_killed(mutant, copy)
                survivors += not killed
                verdict = "killed" if killed else "SURVIVED"
            line = f"{number}/{len(mutants)} {verdict:12} {mutant.driver:12} {mutant.what}"
            print(line, flush=True)  # noqa: T201
    print(f"{len(mutants)} mutants, {survivors} survived")  # noqa: T201
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
