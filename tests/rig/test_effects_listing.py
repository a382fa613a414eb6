"""`rig effects`: every effect a diagnosis can name is described."""

import json

from estimation.effects import catalogue
from rig.cli.main import main


def test_every_effect_is_listed_with_a_sentence(capsys):
    assert main(["effects"]) == 0
    out = capsys.readouterr().out
    lines = {line.split()[0]: line.split(maxsplit=1)[1] for line in out.splitlines()}
    for name in catalogue():
        assert len(lines[name].split()) >= 2, name


def test_a_family_is_listed_by_the_beginning_of_its_names(capsys):
    assert main(["effects", "friction", "--json"]) == 0
    ids = [one["id"] for one in json.loads(capsys.readouterr().out)["effects"]]
    assert "friction.coulomb" in ids
    assert all(name.startswith("friction.") for name in ids)


def test_an_effect_is_described_with_equation_and_parameters(capsys):
    for name, one in catalogue().items():
        assert main(["effects", name]) == 0
        out = capsys.readouterr().out
        assert "Equation" in out
        for parameter in (*one.amplitudes, *one.shape):
            assert f"parameter {parameter.name}: {parameter.description}" in out


def test_an_effect_that_is_not_there_is_a_slip_and_the_nearest_is_named(capsys):
    assert main(["effects", "friction.colomb"]) == 2
    assert "friction.coulomb" in capsys.readouterr().err
