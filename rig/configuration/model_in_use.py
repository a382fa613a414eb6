"""The model in use for a rig: a copy of a fitted model, chosen by hand, before the configured one.

`models/` in the folder of a person's configurations holds the copies, each named after its content,
and `in-use.jsonl`, to which each choice adds a line; a rig's last line counts. It is for the rig's
name, which its recordings carry.
"""

import json
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path

from calibration.store import own_folder
from estimation.files import OutputError, write_bytes_atomic

CHOICES = "in-use.jsonl"
DIGITS = 8


@dataclass(frozen=True, slots=True)
class Choice:
    """A choice for a rig, at a time in ISO 8601: the name of the copy, and the file it was made of.

    Without a name the rig goes back to the configured model.
    """

    rig: str
    model: str | None
    source: str
    at: str

    @property
    def path(self) -> Path | None:
        """The copy."""
        return None if self.model is None else models_folder() / self.model


def models_folder() -> Path:
    """Return the folder of the copies."""
    return own_folder() / "models"


def choices() -> list[Choice]:
    """Return all choices, the oldest first; OutputError where their file is damaged."""
    file = models_folder() / CHOICES
    if not file.is_file():
        return []
    try:
        return [Choice(**json.loads(line)) for line in file.read_text("utf-8").splitlines()]
    except (OSError, ValueError, TypeError) as error:
        raise OutputError(
            f"The choices of models in {file} cannot be read.",
            str(error),
            "Move the file away; then `rig model use` chooses again.",
        ) from error


def model_in_use(rig: str) -> Path | None:
    """Return the model chosen for a rig; None where nobody chose one."""
    own = [choice for choice in choices() if choice.rig == rig]
    return own[-1].path if own else None


def choose(rig: str, source: Path | None, at: str) -> None:
    """Copy a model and make it the one in use for a rig; None for the configured one again."""
    name = None
    if source is not None:
        content = source.read_bytes()
        digest = sha256(content).hexdigest()[:DIGITS]
        stem = source.name.removesuffix(source.suffix).removesuffix(f"-{digest}")
        name = f"{stem}-{digest}{source.suffix}"
        write_bytes_atomic(models_folder() / name, content)
    made = Choice(rig, name, "" if source is None else str(source), at)
    folder = models_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / CHOICES).open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(made)) + "\n")
