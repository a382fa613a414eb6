"""One archive with what a colleague needs to answer a question about a rig, and no secrets."""

import getpass
import io
import json
import platform
import re
import sys
import zipfile
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from calibration.errors import CalibrationError
from calibration.store import CalibrationStore, default_folder
from estimation.files import write_bytes_atomic
from rig import __version__
from rig.campaigns.index import campaigns, default_index
from rig.configuration.config import Config
from rig.doctor.finding import Finding
from rig.errors import DataError
from rig.log.check import check_log, logs_in
from rig.output.console import plain
from rig.output.provenance import Provenance

RECORDINGS = Path("logs")
HIDDEN = "***"

CREDENTIALS = re.compile(r"(?<=//)[^/@\s\"']+@")
TOKEN = re.compile(r"(?i)\b(token|password|passwd|secret|key)(=|\"?: ?\"?)[^\s\"'&,}]+")


def write_bundle(path: Path, settings: Config, findings: Sequence[Finding]) -> list[str]:
    """Write the archive, `.zip`; returns the names of the files in it.

    Raises:
        OutputError: The archive cannot be written.
    """
    content = {
        "versions.json": _versions(),
        "findings.json": plain(findings),
        "configuration.json": plain(settings.logged()),
        "calibrations.json": _calibrations(),
        "newest_campaign.json": _newest_campaign(),
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, value in content.items():
            archive.writestr(name, without_secrets(json.dumps(value, indent=1, default=str)))
    write_bytes_atomic(path, packed.getvalue())
    return list(content)


def without_secrets(text: str) -> str:
    """Return a text without credentials, the user's name and the path of the user's home."""
    text = CREDENTIALS.sub(f"{HIDDEN}@", text)
    text = TOKEN.sub(rf"\1\g<2>{HIDDEN}", text)
    text = text.replace(str(Path.home()), "~")
    user = getpass.getuser()
    return re.sub(rf"\b{re.escape(user)}\b", "USER", text) if len(user) > 2 else text


def _versions() -> dict[str, Any]:
    packages = {d.metadata["Name"]: d.version for d in metadata.distributions()}
    return {
        "rig": __version__,
        "commit": Provenance.now(0).commit,
        "python": sys.version,
        "system": platform.platform(),
        "packages": dict(sorted(packages.items(), key=lambda item: str(item[0]).lower())),
    }


def _calibrations() -> Any:
    """Return the active calibrations in short, or why they cannot be read."""
    try:
        active = CalibrationStore(default_folder()).active()
    except (CalibrationError, OSError) as error:
        return {"error": str(error)}
    return {
        " ".join(key): {"hash": record.content_hash, "made_at": record.made_at}
        for key, record in active.items()
    }


def _newest_campaign() -> Any:
    """Return the index and the check of the newest campaign, without samples."""
    found = campaigns(RECORDINGS, default_index(RECORDINGS)) if RECORDINGS.is_dir() else []
    if not found:
        return None
    reports: list[Any] = []
    for path in logs_in(found[0].folder):
        try:
            reports.append(check_log(path))
        except DataError as error:
            reports.append({"path": path, "error": str(error)})
    return {"campaign": plain(found[0]), "checks": plain(reports)}
