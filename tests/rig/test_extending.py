"""The templates of `docs/extending.md`, installed as another package would be."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import LinkError
from estimation.effects import UnknownEffectError, catalogue, effect
from tests.estimation import test_effects as contract

PAGE = Path(__file__).parents[2] / "docs" / "extending.md"
MODULE = re.compile(r'```python title="(\w+)\.py"\n(.*?)```', re.DOTALL)
ENTRY = re.compile(r"```toml\n\[project\.entry-points\.\"([\w.]+)\"\]\n(\w+) = \"(.*?)\"\n```")


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put the page's modules and entry points on the path, as pip would."""

    def _install(changed=lambda text: text):
        text = PAGE.read_text()
        for name, code in MODULE.findall(text):
            (tmp_path / f"{name}.py").write_text(changed(code))
            monkeypatch.delitem(sys.modules, name, raising=False)
        info = tmp_path / "acme-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
        entries = [f"[{group}]\n{name} = {value}\n" for group, name, value in ENTRY.findall(text)]
        (info / "entry_points.txt").write_text("\n".join(entries))
        monkeypatch.syspath_prepend(tmp_path)
        catalogue.cache_clear()

    yield _install
    monkeypatch.undo()
    catalogue.cache_clear()


def test_the_templates_effect_keeps_the_contract_of_every_effect(install, said):
    install()
    kind = effect("friction.cubic")
    contract.test_an_effect_is_documented_and_its_parameters_have_units_and_bounds(kind)
    contract.test_a_search_may_enter_it_in_each_balance_it_names_with_units(kind)
    contract.test_a_sample_that_is_not_finite_spoils_no_later_one(kind)
    contract.test_columns_stay_finite_on_constant_and_repeated_samples(kind, 0.4)
    assert "cube of speed" in said("effects friction.cubic").out


def test_the_templates_importer_opens_its_files(install, tmp_path, said):
    install()
    folder = tmp_path / "bench"
    folder.mkdir()
    time_s = np.arange(4000) / 1000
    torque_n_m = 0.3 * np.sin(time_s)
    rows = np.column_stack([time_s * 1e3, 400 * torque_n_m, torque_n_m * 1e2])
    np.savetxt(folder / "a.acme", rows)
    said("log export", folder, "--format csv --out", tmp_path / "t.csv")
    head = (tmp_path / "t.csv").read_text().splitlines()[0]
    assert '"motor_current_a","proximal_torque_n_m"' in head


def test_the_logger_alone_runs_as_its_page_states(capsys):
    text = (PAGE.parent / "one-khz.md").read_text()
    opened, whole = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    with pytest.raises(LinkError, match="16c0:0483"):
        exec(opened, {})  # noqa: S102  no board is plugged in here
    exec(whole, {})  # noqa: S102
    assert re.match(r"1\d{3} samples, 0 lost\n", capsys.readouterr().out)


def test_an_effect_that_does_not_load_or_takes_a_name_is_refused(install):
    install(lambda code: code.replace("friction.cubic", "friction.drag"))
    with pytest.raises(UnknownEffectError, match=r"acme.*friction\.drag"):
        catalogue()
