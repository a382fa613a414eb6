"""Outputs replace files of their own kind, and nothing else."""

import io
import json
from pathlib import Path

import numpy as np
import pytest

from estimation.file_kinds import JSON, MODEL, kind_of
from estimation.files import OutputError, check_output, write_bytes_atomic, write_text_atomic

MODEL_TEXT = 'schema = "rig.model/1"\nname = "grip"\n'
TEXTS = {
    "model": MODEL_TEXT,
    "config": 'name = "bench"\n[logger]\nurl = "sim://"\n',
    "protocol": 'name = "short"\n[[runs]]\nkind = "sine"\n',
    "diagnosis": json.dumps({"schema": "rig.diagnosis/1", "seal": "0"}),
    "campaign": json.dumps({"protocol": {}, "config": {}, "config_sha256": "0"}),
    "result": json.dumps({"runs": 3}),
    "ledger": '{"date": 1, "seal": "0"}\n{"date": 2, "seal": "1"}\n',
    "page": "<!doctype html><title>t</title>",
    "figure": '<?xml version="1.0"?><svg/>',
    "markdown": "## T\n\n| a | b |\n",
    "header": "/* grip */\n#pragma once\n",
    "csv": "time_s,motor_current_a\n0,1\n",
    "measured": "0.1\t0.2\t0.3\n0.2\t0.3\t0.4\n",
}


def arrays(**content: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **content)
    return file.getvalue()


CONTENTS = {name: text.encode() for name, text in TEXTS.items()} | {
    "recording": b"\x89MCAP0\r\n...",
    "picture": b"\x89PNG\r\n",
    "unknown": b"\x00\xff",
    "damaged": b"PK\x03\x04",
    "arrays": arrays(time_s=np.zeros(3)),
    "estimator": arrays(schema=np.array("rig.estimator/1")),
}


@pytest.mark.parametrize("new", CONTENTS)
@pytest.mark.parametrize("old", CONTENTS)
def test_a_file_is_replaced_by_its_own_kind_only(tmp_path: Path, old: str, new: str) -> None:
    path = tmp_path / "file"
    write_bytes_atomic(path, CONTENTS[old])
    if old == new:
        write_bytes_atomic(path, CONTENTS[new])
        return
    with pytest.raises(OutputError, match=r"file is .*not replaced"):
        write_bytes_atomic(path, CONTENTS[new])
    assert path.read_bytes() == CONTENTS[old]
    assert list(tmp_path.iterdir()) == [path]


def test_a_ledger_grows_from_its_first_line(tmp_path: Path) -> None:
    path, line = tmp_path / "looks.jsonl", '{"date": 1, "seal": "0"}\n'
    for lines in (1, 2, 3):
        write_text_atomic(path, lines * line)
    assert path.read_text() == 3 * line


def test_an_empty_file_is_filled(tmp_path: Path) -> None:
    path = tmp_path / "out.toml"
    path.touch()
    write_text_atomic(path, MODEL_TEXT)
    assert kind_of(path.read_bytes()) == MODEL


@pytest.mark.parametrize("path", ["/dev/null/x", "/dev/null", "/"])
def test_a_place_that_cannot_be_written_is_refused_before_and_when_writing(path: str) -> None:
    with pytest.raises(OutputError):
        check_output(Path(path), JSON)
    with pytest.raises(OutputError):
        write_text_atomic(Path(path), "{}")


def test_a_check_leaves_nothing_behind(tmp_path: Path) -> None:
    check_output(tmp_path / "folder" / "out.json", JSON)
    check_output(None, JSON)
    assert list((tmp_path / "folder").iterdir()) == []
