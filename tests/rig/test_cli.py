"""The command line's skeleton: instant help, errors in three lines, exit codes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

from estimation.effects import catalogue
from rig.cli.main import app, main
from rig.errors import ExitCode, exit_code_of
from rig.output.console import plain

pytestmark = pytest.mark.integration


def run_without(heavy, *words):
    """Run the command in a process of its own, which fails when it imports one of these."""
    code = (
        f"import sys; from rig.cli.main import main; main({list(words)});"
        f"heavy = {heavy} & set(sys.modules);"
        "sys.exit(f'imported: {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done


def test_help_imports_nothing_heavy():
    heavy = {"torch", "numba", "scipy", "matplotlib", "numpy", "pyarrow", "pydantic"}
    assert "record" in run_without(heavy, "--help").stdout


@pytest.mark.parametrize(
    "words", ["machine check FILE .", "fit . --machine FILE", "diagnose . --machine FILE"]
)
def test_a_slip_in_a_machine_file_is_named_before_anything_heavy_is_imported(tmp_path, words):
    file = tmp_path / "bench.toml"
    file.write_text('schema = "rig.machine/1"\n[machine]\nnam = "bench"\n')
    done = run_without({"numba", "scipy"}, *words.replace("FILE", str(file)).split())
    assert "Did you mean 'nam'?" in done.stderr


SLIPS = {
    "recrod": "recrod",
    "effects friction.colomb": "friction.coulomb",
    "machine show emsp": "Did you mean 'emps'",
    "machine new new.toml --axis carriage:mm": "has the unit 'mm'",
    "machine new new.toml --axis carriage": "is not NAME:rad or NAME:m",
    "machine new new.toml --axis a:rad --sensor b:a_angle_rad": "There is no axis 'b'",
    "machine new new.toml --axis a:rad --sensor a:a_angle_deg": "'a_angle_deg' carries no unit",
    "machine new new.toml --axis a:rad --axis b:rad --transmission a:b:x": "is not a number",
    "diagnose . --equation elbow": "elbow",
    "diagnose --plan quick --machine emps": "recordings of the machine instead",
    "diagnose --plan no-such-protocol": "no protocol",
    "loop": "--sim",
    "live --sim --lever-mm 0": "A lever arm of 0 mm gives no force",
    "campaigns --most -3": "--most",
    "calibrate torque --sim --yes --masses-g abc": "fix: Give them as in",
    "calibrate torque --sim --yes --masses-g 50,40": "fix: Give --masses-g in rising order",
    "grip --torque 1.0": "cannot be held",
    "grip --torque 0": "cannot be held",
    "grip --torque -0.1": "cannot be held",
    "grip --torque nan": "cannot be held",
    "grip --torque 0.05 --duration inf --sim": "--duration inf cannot be used",
    "grasper follow --sim --duration inf": "--duration inf cannot be used",
    "live -c simulatd": "Did you mean 'simulated'",
    "live --sim --duration -1": "--duration -1 cannot be used",
    "live --sim --duration nan": "--duration nan cannot be used",
    "live --sim --pace -1": "--pace -1 cannot be used",
    "live --sim --pace nan": "--pace nan cannot be used",
    "reference --yes -c canopen": "no board to reference",
    "reference --yes --sim --at 0 --at 1": "spindle_angle_rad",
    "reference --yes -c grasper --at 0": "yaw_angle_rad, jaw_1_angle_rad, jaw_2_angle_rad",
    "study zhao --prototype fourth": "third, journal, ball",
    "study machines .": "No machine's recordings",
}
"""Commands that cannot be meant, and a part of what is said."""


@pytest.mark.parametrize("words", SLIPS)
def test_a_slip_is_a_usage_error_that_names_it_or_what_may_be_meant(
    words, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert SLIPS[words] in said(words, code=ExitCode.USAGE).err
    assert list(tmp_path.iterdir()) == []


def test_an_error_that_nobody_raised_on_purpose_has_its_own_code():
    assert exit_code_of(ValueError("x")) == 70


@pytest.mark.parametrize("module", ["rig.cli.record", "estimation.effects.ripple_motor"])
def test_ctrl_c_while_modules_are_loaded_shows_no_traceback(module):
    """The second module is loaded by the command; a compiled one may end in an ImportError."""
    code = f"""
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job of a shell ignores it
from rig.__main__ import run
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                raise ImportError("initialization failed") from None
sys.meta_path.insert(0, Finder())
sys.argv = ["rig", "effects"]
run()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr, done.stdout) == (130, "Interrupted.\n", "")


@pytest.mark.parametrize("words", [["effects"], ["effects", "--json"], ["loop", "--json"]])
def test_a_result_that_cannot_be_written_is_an_error_without_traceback(words, tmp_path):
    if not Path("/dev/full").exists():
        pytest.skip("a device that is always full is there on Linux only")
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "rig", *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            cwd=tmp_path,
        )
    assert done.returncode == ExitCode.USAGE
    assert done.stderr.count("error: ") == 1
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr


def verbs(command, words=()):
    """Yield every verb of the command line and its options that take no value."""
    if not getattr(command, "commands", None):
        switches = [p for p in command.params if getattr(p, "is_flag", False)]
        yield " ".join(words), {o for p in switches for o in p.opts}
        return
    for name, part in command.commands.items():
        yield from verbs(part, (*words, name))


def test_json_is_a_switch_of_every_command():
    found = dict(verbs(get_command(app)))
    assert {"record", "calibrate list", "firmware flash", "study zhao"} <= set(found)
    assert [words for words, switches in found.items() if "--json" not in switches] == []


@pytest.mark.parametrize("words", ["", "record", "cal list", "calibrate torque"])
def test_help_has_a_short_option_too(words, said):
    short = said(words, "-h").out
    assert said(words, "--help").out == short
    assert "..." not in short.replace("COMMAND [ARGS]...", "")


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("rig rep", {"replay"}),
        ("rig re", {"record", "reference", "replay"}),
        ("rig record --protocol d", {"diagnosis"}),
        ("rig record --config gra", {"grasper", "grasper_pty"}),
        ("rig record --config b", {"bench.toml"}),
        ("rig fit --model gr", {"grip"}),
        ("rig diagnose logs/mo", {"logs/monday"}),
        ("rig diagnose logs/monday --model gea", {"gearbox"}),
        ("rig campaigns mond", {"monday"}),
    ],
)
def test_the_shell_completes_commands_and_names(words, wanted, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bench.toml").touch()
    (tmp_path / "logs" / "monday").mkdir(parents=True)
    (tmp_path / "logs" / "monday" / "a.mcap").touch()
    monkeypatch.setenv("_RIG_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    main([])
    assert set(capsys.readouterr().out.split()) == wanted


@pytest.mark.parametrize("words", ["devices", "calibrate list", "config show", "grasper designs"])
def test_results_go_to_stdout_alone_and_as_json_where_asked(words, said, answered):
    out, err = said(words)
    assert out.strip()
    assert err == ""
    assert isinstance(answered(words), dict)


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


def test_every_effect_is_listed_with_a_sentence(said):
    lines = dict(line.split(maxsplit=1) for line in said("effects").out.splitlines())
    for name in catalogue():
        assert len(lines[name].split()) >= 2, name


def test_a_family_is_listed_by_the_beginning_of_its_names(answered):
    ids = {one["id"] for one in answered("effects friction")["effects"]}
    assert ids == {name for name in catalogue() if name.startswith("friction.")}


def test_an_effect_is_described_with_equation_and_parameters(said):
    for name, one in catalogue().items():
        out = said("effects", name).out
        assert "Equation" in out
        assert ("of other machines" in out) == bool(one.balances)
        for parameter in (*one.amplitudes, *one.shape):
            assert f"parameter {parameter.name}: {parameter.description}" in out
