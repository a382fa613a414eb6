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

BALANCES = st.sampled_from(["motor", "stretch", "joint.3", "calibration.force", "table"])
ALL_VARIABLES = [*VARIABLES, "joint_4", "link_angle", "joint_2_velocity", "flow_m3_s"]
NUMBERS = st.floats() | st.sampled_from([float("nan"), float("inf")])
PAIRS = st.none() | st.tuples(NUMBERS, NUMBERS)
RUNS = st.lists(st.text(min_size=1), max_size=3).map(tuple)


FAMILIES = st.sampled_from(families())
VALUES = st.builds(Value, NUMBERS, st.sampled_from(["N m", "1"]), PAIRS)
FINDINGS = st.builds(
    Finding,
    balance=BALANCES,
    error_of=BALANCES,
    family=FAMILIES,
    verdict=st.sampled_from(VERDICTS[:-2]),
    rmse_before=NUMBERS,
    rmse_after=NUMBERS,
    runs_improved=st.integers(0, 9),
    runs_affected=RUNS,
    alternatives=st.lists(FAMILIES, max_size=2).map(tuple),
    depends_on=st.lists(st.sampled_from(ALL_VARIABLES), max_size=2).map(tuple),
    confidence=st.floats(0, 1) | st.none(),
    parameters=st.dictionaries(st.text(min_size=1), VALUES, max_size=2),
    place=st.sampled_from(["motor", "sensor distal_torque_n_m"]),
    probabilities=st.dictionaries(FAMILIES, st.floats(0, 1), max_size=2),
)
ERRORS = st.builds(
    Error, *[NUMBERS] * 4, st.tuples(NUMBERS, NUMBERS), *[st.just(dict[str, float]())] * 2
)
MOVED = st.fixed_dictionaries(
    {"friction.coulomb.friction": st.fixed_dictionaries({"before": NUMBERS, "after": NUMBERS})}
)
DIAGNOSES = st.builds(
    Diagnosis,
    findings=st.lists(FINDINGS, max_size=3).map(tuple),
    errors=st.dictionaries(BALANCES, ERRORS, max_size=3),
    unit=st.dictionaries(BALANCES, st.just("N m"), max_size=3),
    noise_floor=st.dictionaries(BALANCES, st.none() | NUMBERS, max_size=3),
    moved=st.dictionaries(BALANCES, MOVED, max_size=3),
    sealed=st.builds(Sealed, RUNS, RUNS, st.just(3), st.just("data"), st.just("seal")),
    exploratory=st.booleans(),
)


@settings(max_examples=60)
@given(diagnosis=DIAGNOSES)
def test_every_field_is_there_and_no_number_is_undefined(diagnosis):
    text = json.dumps(diagnosis.to_json(), allow_nan=False)
    found: dict[str, Any] = json.loads(text)
    DiagnosisSchema.model_validate(found)
    assert found["schema"] == SCHEMA
    weakest = max((f["verdict"] for f in found["findings"]), key=VERDICTS.index, default="")
    assert found["verdict"] == (weakest or "nothing_missing")
    assert [f["family"] for f in found["findings"]] == [f.family for f in diagnosis.findings]


def test_the_published_schema_is_the_one_that_checks_and_nothing_is_optional():
    schema = json.loads((Path(__file__).parents[2] / FILE).read_text())
    assert json_schema() == json.dumps(schema, indent=2) + "\n"
    finding = schema["$defs"]["Finding"]
    assert set(schema["required"]) == set(schema["properties"])
    assert set(finding["required"]) == set(finding["properties"])
    assert finding["additionalProperties"] is False
    assert set(finding["properties"]["family"]["enum"]) == set(families())


@pytest.mark.parametrize(
    "change",
    [
        {"verdict": "perhaps"},
        {"seconds": float("nan")},
        {"unit": {"the elbow": "N m"}},
        {"runs": {"discover": []}},
    ],
)
def test_the_contract_refuses_what_it_does_not_allow(change):
    found = Diagnosis((), {}, {}, {}, {}, Sealed((), (), 0, "", "")).to_json()
    DiagnosisSchema.model_validate(found)
    with pytest.raises(ValueError, match=re.escape(next(iter(change)))):
        DiagnosisSchema.model_validate(found | change)
