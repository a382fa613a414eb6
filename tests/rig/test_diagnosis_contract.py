"""The published contract of a diagnosis: every field is there, null for what is not defined."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.diagnosis.result import (
    SCHEMA,
    VARIABLES,
    VERDICTS,
    Diagnosis,
    Error,
    Finding,
    Value,
)
from estimation.diagnosis.split import Sealed
from estimation.effects import families
from rig.diagnosis.schema import FILE, DiagnosisSchema, json_schema

FIELDS = {
    "schema", "verdict", "findings", "rmse_before", "rmse_after", "rmse_with_means_before",
    "rmse_with_means_after", "unit", "noise_floor", "runs", "next_experiment",
    "declared_parameters_moved", "exploratory", "seed", "seconds",
}  # fmt: skip
OF_FINDING = {
    "balance", "also_in", "place", "family", "verdict", "alternatives", "probabilities",
    "depends_on", "confidence", "parameters", "rmse_before", "rmse_after", "runs_improved",
    "runs_total", "runs_affected",
}  # fmt: skip

BALANCES = st.sampled_from(["motor", "gearbox", "cable", "stretch", "joint.3", "calibration.force"])
NUMBERS = st.floats() | st.sampled_from([float("nan"), float("inf")])
PAIRS = st.none() | st.tuples(NUMBERS, NUMBERS)
RUNS = st.lists(st.text(min_size=1), max_size=3).map(tuple)


@st.composite
def findings(draw: st.DrawFn) -> Finding:
    verdict = draw(st.sampled_from(VERDICTS[:-1]))
    named = verdict in ("identified", "one_of")
    family = draw(st.sampled_from(families()[:-1])) if named else "unknown"
    others = [f for f in families()[:-1] if f != family]
    values = st.builds(Value, NUMBERS, st.sampled_from(["N m", "1"]), PAIRS)
    return Finding(
        balance=draw(BALANCES),
        family=family,
        verdict=verdict,
        rmse_before=draw(NUMBERS),
        rmse_after=draw(NUMBERS),
        runs_improved=draw(st.integers(0, 9)),
        runs_total=9,
        runs_affected=draw(RUNS),
        alternatives=tuple(draw(st.lists(st.sampled_from(others), max_size=2))) if named else (),
        depends_on=tuple(draw(st.lists(st.sampled_from([*VARIABLES, "joint_4"]), max_size=2))),
        confidence=draw(st.floats(0, 1) | st.none()),
        parameters=draw(st.dictionaries(st.text(min_size=1), values, max_size=2)),
        place=draw(st.sampled_from(["motor", "sensor distal_torque_n_m"])),
        probabilities={family: draw(st.floats(0, 1))},
    )


@st.composite
def diagnoses(draw: st.DrawFn) -> Diagnosis:
    found = tuple(draw(st.lists(findings(), max_size=3)))
    error = st.builds(
        Error, NUMBERS, NUMBERS, NUMBERS, NUMBERS, st.tuples(NUMBERS, NUMBERS), st.just({}),
        st.just({}),
    )  # fmt: skip
    names = draw(st.lists(BALANCES, unique=True, max_size=3))
    moved = {"friction.coulomb.friction": {"before": draw(NUMBERS), "after": draw(NUMBERS)}}
    return Diagnosis(
        findings=found,
        errors={name: draw(error) for name in names},
        unit=dict.fromkeys(names, "N m"),
        noise_floor={name: draw(st.none() | NUMBERS) for name in names},
        moved=dict.fromkeys(names, moved),
        sealed=Sealed(draw(RUNS), draw(RUNS), 3, "data", "seal"),
        exploratory=draw(st.booleans()),
        seconds=1.5,
    )


@settings(deadline=None, max_examples=60)
@given(diagnosis=diagnoses())
def test_every_field_is_there_and_no_number_is_undefined(diagnosis: Diagnosis) -> None:
    text = json.dumps(diagnosis.to_json(), allow_nan=False)
    found: dict[str, Any] = json.loads(text)
    assert found.keys() >= FIELDS
    assert found["schema"] == SCHEMA
    weakest = max((f["verdict"] for f in found["findings"]), key=VERDICTS.index, default="")
    assert found["verdict"] == (weakest or "nothing_missing")
    assert [f["family"] for f in found["findings"]] == [f.family for f in diagnosis.findings]
    for finding in found["findings"]:
        assert finding.keys() == OF_FINDING
        assert finding["family"] not in finding["alternatives"]
        for known in finding["parameters"].values():
            assert known.keys() == {"value", "unit", "ci95"}
    assert found["runs"].keys() == {"discover", "confirm"}
    DiagnosisSchema.model_validate(found)


def test_the_published_schema_requires_every_field_and_lists_every_family() -> None:
    schema = json.loads(json_schema())
    assert (Path(__file__).parents[2] / FILE).read_text() == json_schema()
    assert set(schema["required"]) == FIELDS
    assert set(schema["$defs"]["Finding"]["required"]) == OF_FINDING
    assert schema["$defs"]["Finding"]["additionalProperties"] is False
    assert set(schema["$defs"]["Finding"]["properties"]["family"]["enum"]) == set(families())


@pytest.mark.parametrize(
    "change",
    [
        {"verdict": "perhaps"},
        {"seconds": float("nan")},
        {"unit": {"elbow": "N m"}},
        {"runs": {"discover": []}},
    ],
)
def test_the_contract_refuses_what_it_does_not_allow(change: dict[str, Any]) -> None:
    found = Diagnosis((), {}, {}, {}, {}, Sealed((), (), 0, "", "")).to_json()
    DiagnosisSchema.model_validate(found)
    with pytest.raises(ValueError, match=re.escape(next(iter(change)))):
        DiagnosisSchema.model_validate(found | change)
