"""The published contract of a diagnosis, `rig.diagnosis/1`, as a schema that checks."""

import json
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from estimation.diagnosis.result import SCHEMA, VARIABLES
from estimation.effects import families

FILE = "docs/schemas/rig.diagnosis-1.json"

Balance = Annotated[str, Field(pattern=r"^\S+$")]
Family = Annotated[str, Field(json_schema_extra={"enum": list(families())})]
Variable = Annotated[str, Field(pattern=r"^\w+$", json_schema_extra={"examples": VARIABLES})]
Name = Literal["identified", "one_of", "depends_on", "something_missing"]
Number = Annotated[float, Field(allow_inf_nan=False)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Parameter(_Strict):
    """A parameter of a named effect."""

    value: Number | None
    unit: str
    ci95: tuple[Number, Number] | None


class Finding(_Strict):
    """One cause."""

    balance: Balance
    also_in: list[Balance]
    place: str
    """Where in the machine it acts."""
    family: Family
    form: str
    """Id of the effect's form that was found, empty of an unknown one."""
    verdict: Name
    alternatives: list[Family]
    alternative_places: dict[Family, str]
    """Of the alternatives that would act at another place."""
    other_places: list[str]
    """Places where an effect of this family lowers the error as much."""
    probabilities: dict[Family, Annotated[float, Field(ge=0, le=1)]]
    """Of the family and its alternatives."""
    no_effect: Annotated[float, Field(ge=0, le=1)]
    """Probability that none of all effects is missing here."""
    depends_on: list[Variable]
    confidence: Annotated[float, Field(ge=0, le=1)] | None
    parameters: dict[str, Parameter]
    error_of: Balance
    """Equation of the errors: its own, or another one where its own does not fall."""
    with_means: bool
    """Whether the means of runs are left in these errors."""
    rmse_before: Number | None
    rmse_after: Number | None
    runs_improved: int
    runs_total: int
    runs_affected: list[str]


class Runs(_Strict):
    """The split."""

    discover: list[str]
    confirm: list[str]


class DiagnosisSchema(BaseModel):
    """A completed diagnosis. Further keys may come; those listed keep their meaning."""

    schema_: Annotated[Literal["rig.diagnosis/1"], Field(alias="schema")]
    verdict: Name | Literal["unexplained", "nothing_missing"]
    findings: list[Finding]
    rmse_before: dict[Balance, Number | None]
    rmse_after: dict[Balance, Number | None]
    rmse_with_means_before: dict[Balance, Number | None]
    rmse_with_means_after: dict[Balance, Number | None]
    unit: dict[Balance, str]
    noise_floor: dict[Balance, Number | None]
    over_noise: dict[Balance, Number]
    runs: Runs
    next_experiment: dict[str, Any] | None
    declared_parameters_moved: dict[Balance, dict[str, dict[str, Number | None]]]
    exploratory: bool
    seed: int
    seconds: Number


def json_schema() -> str:
    """Return the JSON Schema as the text of the published file."""
    schema = DiagnosisSchema.model_json_schema(by_alias=True)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = SCHEMA
    return json.dumps(schema, indent=2) + "\n"
