"""Machines drawn at random: a seed draws one machine, and the library reads its files."""

import numpy as np
import pytest

import rig
from benchmarks.diagnosis.case import MACHINE_FILE
from benchmarks.diagnosis.strangers import KINDS, NAMED, UNNAMED, draw, is_geared
from estimation.effects import families

pytestmark = pytest.mark.integration
SEEDS = (1000100, 1000101)


def test_every_family_of_a_hidden_effect_is_of_the_catalogue():
    assert {name for effect in NAMED.values() for name in effect.families} <= {*families()}
    assert {effect.families for effect in UNNAMED.values()} == {("unknown",)}


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_draws_the_same_files_and_the_library_reads_them(tmp_path, kind):
    for seed in SEEDS:
        folders = [tmp_path / f"{seed}-{copy}" for copy in range(2)]
        for folder in folders:
            folder.mkdir()
        first, second = (draw(seed, kind, folder) for folder in folders)
        assert first == second
        assert len(first) == (kind != "clean")
        one, other = ([p.read_bytes() for p in sorted(f.iterdir())] for f in folders)
        assert one == other
        machine = folders[0] / MACHINE_FILE
        campaign = rig.read(folders[0], machine=machine)
        assert len(campaign) >= 9
        equations = {model.name for model in rig.declared(machine=machine)}
        assert all({*places} <= equations for _, places, _ in first)


def test_machines_of_both_kinds_are_drawn():
    assert {is_geared(np.random.default_rng(seed)) for seed in range(40)} == {True, False}
