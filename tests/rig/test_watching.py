"""The residual watch where it is used: while recording, and on a live or replayed stream."""

from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.fitting import fit
from estimation.recording import Recording
from rig.diagnosis.subject import declared_models
from rig.importers.registry import open_campaign
from rig.live.block import through
from rig.live.estimator import estimators_of
from rig.live.replay import replay_blocks
from rig.live.status import FitStatus
from rig.recording.campaign import open_campaign_folder, record_campaign
from rig.recording.watch import watch_runs
from tests.estimation import synthetic
from tests.rig.simulated import protocol_file, session, short_protocol, simulated

pytestmark = pytest.mark.integration

SHORT = short_protocol(5, duration_s=3.0)


def record(folder: Path, **simulation) -> list[Path]:
    config = simulated(**simulation)
    plans = open_campaign_folder(folder, SHORT, config, resume=False)
    with session(config) as rig:
        return [result.path for result in record_campaign(rig, plans, folder)]


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("fitted")
    record(folder / "logs", seed=1)
    fitted = fit(model_file.read(Path("motor")), open_campaign(folder / "logs"), bootstrap=0)
    path = folder / "motor.model.toml"
    model_file.write(fitted, path)
    return path


def test_an_effect_that_begins_at_a_run_is_dated_to_it(model, tmp_path):
    watch = watch_runs(model)
    said = [watch.after(path) for path in record(tmp_path / "before", seed=2)]
    assert all(model["fits"] for model in watch.to_json())
    hidden = {"motor_ripple": 1.5}
    said += [watch.after(path) for path in record(tmp_path / "after", seed=3, hidden=hidden)]
    (news,) = [words for words in said if words]
    assert "stops fitting, since run 000" in news  # the first run of the second campaign
    assert said.index(news) >= 5
    assert not all(model["fits"] for model in watch.to_json())
    (told,) = watch.to_json()
    assert told["since"].startswith("000")


def test_record_reports_the_result_of_the_monitor(model, tmp_path, answered):
    protocol = protocol_file(tmp_path, runs=2, duration_s=2.0)
    (watched,) = answered("record -p", protocol, "-o", tmp_path / "logs", "--model", model)[
        "models"
    ]
    assert watched["fits"] is True
    assert len(watched["runs"]) == 2


def test_a_model_of_another_machine_is_refused_before_anything_moves(model, tmp_path, said):
    foreign = tmp_path / "foreign.model.toml"
    foreign.write_text(model.read_text().replace("motor_current_a", "crosshead_current_a"))
    words = ("record --sim --protocol quick --model", foreign, "-o", tmp_path / "logs")
    assert "crosshead_current_a, which simulated rig does not measure" in said(*words, code=2).err
    assert not (tmp_path / "logs").exists()


def test_a_file_of_several_balances_is_watched_whole_and_its_first_runs_live(model, tmp_path):
    logs = open_campaign(model.parent / "logs")
    gearbox = fit(model_file.read(Path("gearbox")), logs, bootstrap=0)
    path = tmp_path / "both.model.toml"
    model_file.write_all([model_file.read(model), gearbox], path)
    assert [one["name"] for one in watch_runs(path).to_json()] == ["motor", "gearbox"]
    (estimator,) = estimators_of(path, 1000.0)
    assert estimator.target_channel == "proximal_torque_n_m"
    assert [m.balance for m in declared_models(path, None)] == ["motor", "gearbox"]
    assert [m.balance for m in declared_models(path, "gearbox")] == ["gearbox"]


def test_a_stream_reports_since_when_its_model_no_longer_fits():
    campaign = synthetic.campaign()
    fitted = fit(model_file.read(Path("motor")), campaign, bootstrap=0)

    def rough(motor_rad, speed_rad_s, load_n_m):
        late = np.arange(len(motor_rad)) >= 30_000
        return np.where(late, 6e-3 * np.sin(4 * motor_rad), 0.0)

    run = synthetic.run("long", 0.35, 0.1, seed=3, seconds=60.0, extra=rough)
    blocks = list(through(replay_blocks(run, (), None), [FitStatus(fitted).step]))
    states = [(block.time_s[-1], block.devices[-1]) for block in blocks]
    assert {status.name for _, status in states} == {"model"}
    early = {status.state for time_s, status in states if time_s < 29}
    assert early == {"watching", "fits"}
    assert states[-1][1].state == "no longer fits"
    # the piece in which it began
    assert states[-1][1].detail.endswith(("since 25 s", "since 30 s"))


def test_a_stream_without_the_models_channels_is_not_watched():
    fitted = fit(model_file.read(Path("motor")), synthetic.campaign(), bootstrap=0)
    time_s = np.arange(7000) * 1e-3
    bare = Recording("bare", time_s, {"distal_torque_n_m": np.zeros(7000)})
    last = list(through(replay_blocks(bare, (), None), [FitStatus(fitted).step]))[-1].devices[-1]
    assert last.state == "not watched"
    assert "channel" in last.detail or "lacks" in last.detail
