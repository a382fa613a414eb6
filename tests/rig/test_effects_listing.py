"""`rig effects`: every effect a diagnosis can name is described."""

from estimation.effects import catalogue


def test_every_effect_is_listed_with_a_sentence(said):
    lines = dict(line.split(maxsplit=1) for line in said("effects").out.splitlines())
    for name in catalogue():
        assert len(lines[name].split()) >= 2, name


def test_a_family_is_listed_by_the_beginning_of_its_names(answered):
    ids = [one["id"] for one in answered("effects friction")["effects"]]
    assert "friction.coulomb" in ids
    assert all(name.startswith("friction.") for name in ids)


def test_an_effect_is_described_with_equation_and_parameters(said):
    for name, one in catalogue().items():
        out = said("effects", name).out
        assert "Equation" in out
        for parameter in (*one.amplitudes, *one.shape):
            assert f"parameter {parameter.name}: {parameter.description}" in out


def test_an_effect_that_is_not_there_is_a_slip_and_the_nearest_is_named(said):
    assert "friction.coulomb" in said("effects friction.colomb", code=2).err
