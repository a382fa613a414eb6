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
ALL_VARIABLES = [*VARIABLES, "joint_4", "link_angle"]
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
        depends_on=tuple(draw(st.lists(st.sampled_from(ALL_VARIABLES), max_size=2))),
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
