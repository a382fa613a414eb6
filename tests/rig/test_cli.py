"""The command line's skeleton: instant help, errors in three lines, exit codes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

from rig.cli.main import app, main
from rig.errors import DataError, ExitCode, UsageError, exit_code_of
from rig.output.console import plain


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from rig.cli.main import main; main(['--help']);"
        "heavy = {'torch', 'numba', 'scipy', 'matplotlib', 'numpy', 'pyarrow', 'pydantic'};"
        "sys.exit(f'imported: {heavy & set(sys.modules)}' if heavy & set(sys.modules) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "record" in done.stdout


def test_an_unknown_verb_is_a_usage_error(capsys):
    assert main(["recrod"]) == ExitCode.USAGE
    assert "recrod" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code"),
    [(UsageError("x"), 2), (DataError("x"), 5), (ValueError("x"), 70)],
)
def test_exit_codes(error, code):
    assert exit_code_of(error) == code


def verbs(command, words=()):
    """Yield every verb of the command line and its options."""
    if not getattr(command, "commands", None):
        yield " ".join(words), {o for p in command.params for o in p.opts}
        return
    for name, part in command.commands.items():
        yield from verbs(part, (*words, name))


def test_every_command_speaks_to_machines():
    found = dict(verbs(get_command(app)))
    assert {"record", "cal list", "firmware flash", "study zhao"} <= set(found)
    assert [words for words, options in found.items() if "--json" not in options] == []


RESULTS = ["devices", "cal list", "config check", "config list", "config show", "grasper designs"]


@pytest.mark.parametrize("words", RESULTS)
def test_results_go_where_a_pipe_finds_them(words, capsys):
    assert main(words.split()) == 0
    out, err = capsys.readouterr()
    assert out.strip()
    assert err == ""


@pytest.mark.parametrize("words", RESULTS)
def test_with_json_stdout_carries_nothing_else(words, capsys):
    assert main([*words.split(), "--json"]) == 0
    assert isinstance(json.loads(capsys.readouterr().out), dict)


def test_a_terminal_without_the_letters_gets_their_codes():
    """The plus-minus of an interval ended `rig live` where stdout is ASCII."""
    words = ["live", "--plain", "--pace", "0", "--duration", "1"]
    done = subprocess.run(
        [sys.executable, "-m", "rig", *words],
        capture_output=True,
        check=False,
        cwd=Path(__file__).parents[2],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 0, done.stderr
    assert b"mN m \\xb1" in done.stdout


def test_json_has_no_nan_and_no_numpy():
    import numpy as np

    value = plain({"a": np.float64("nan"), "b": np.arange(2), "c": (1, float("inf"))})
    assert json.dumps(value, allow_nan=False) == '{"a": null, "b": [0, 1], "c": [1, null]}'
