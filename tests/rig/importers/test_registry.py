"""A third party adds a format by an entry point; the registry finds it and skips nothing."""

import types
from importlib.metadata import EntryPoint, EntryPoints

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.recording import Recording
from rig.errors import DataError, UsageError
from rig.importers import registry
from rig.importers.registry import importers, open_campaign

OWN = {
    "dvrk-psm": "rig.importers.dvrk_psm:IMPORTER",
    "matlab": "rig.importers.matlab:IMPORTER",
    "mrdlab": "rig.importers.mrdlab:IMPORTER",
}


class AcmeImporter:
    name = "acme"
    description = "a third party's format"

    def recognises(self, path):
        return path.suffix == ".acme"

    def open(self, path):
        values = np.loadtxt(path)
        recording = Recording(path.stem, np.arange(values.size) / 10, {"motor_current_a": values})
        return Campaign.of([recording])


@pytest.fixture
def installed(monkeypatch):
    """Install entry points in addition to the project's own, as a package would."""

    def _install(**values):
        entries = [EntryPoint(n, v, "rig.importers") for n, v in {**OWN, **values}.items()]
        monkeypatch.setattr(
            "importlib.metadata.entry_points",
            lambda group: EntryPoints(entries).select(group=group),
        )
        monkeypatch.setattr(registry, "entry_points", lambda group: EntryPoints(entries))

    module = types.ModuleType("acme_rig")
    module.IMPORTER, module.NOTHING = AcmeImporter(), object()
    monkeypatch.setitem(__import__("sys").modules, "acme_rig", module)
    return _install


def test_a_third_party_format_opens_by_its_entry_point(installed, tmp_path):
    installed(acme="acme_rig:IMPORTER")
    path = tmp_path / "first.acme"
    path.write_text("1\n2\n3\n")
    assert list(importers()) == ["acme", *OWN]
    (recording,) = open_campaign(path)
    assert recording["motor_current_a"].tolist() == [1, 2, 3]
    assert open_campaign(path, "acme").names == ("first",)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("acme_gone:IMPORTER", "cannot be loaded: No module named 'acme_gone'"),
        ("acme_rig:GONE", "cannot be loaded"),
        ("acme_rig:NOTHING", "is not an importer"),
    ],
)
def test_an_entry_point_that_does_not_load_is_named(installed, value, message):
    installed(acme=value)
    with pytest.raises(UsageError, match=message):
        importers()


def test_each_format_is_distinguished_from_the_others(installed, tmp_path, make_log):
    from scipy.io import savemat

    installed()
    log, psm, mat = tmp_path / "00.TXT", tmp_path / "one.csv", tmp_path / "run.mat"
    log.write_text(make_log(seconds=1.0).text())
    psm.write_text(3 * (",".join(["0.5"] * 21) + "\n"))
    savemat(mat, {"time_s": np.arange(9) / 10, "motor_current_a": np.ones(9)})
    for path, name in ((log, "mrdlab"), (psm, "dvrk-psm"), (mat, "matlab")):
        assert [n for n, i in importers().items() if i.recognises(path)] == [name]
        assert open_campaign(path).names == (path.stem,)
    assert [n for n, i in importers().items() if i.recognises(tmp_path)] == ["dvrk-psm", "mrdlab"]


def test_an_unknown_format_is_refused_with_the_list(installed, tmp_path):
    installed()
    path = tmp_path / "run.xyz"
    path.write_text("?")
    with pytest.raises(DataError, match="dvrk-psm, matlab, mrdlab"):
        open_campaign(path)
    with pytest.raises(UsageError, match="no importer 'acme'"):
        open_campaign(path, "acme")
    with pytest.raises(UsageError, match="no file or folder"):
        open_campaign(tmp_path / "gone")
