"""Which kind of file a content is, so that an output replaces its own kind only."""

import io
import json
import tomllib
import zipfile
from typing import Any

RECORDING = "a recording (MCAP)"
MODEL = "a model file"
PROTOCOL = "a protocol"
TOML = "a TOML file"
JSON = "a JSON file"
CAMPAIGN = "the record of a campaign"
LEDGER = "the ledger of diagnoses"
DIAGNOSIS = f"{JSON} of rig.diagnosis/1"
HTML = "a page (HTML)"
SVG = "a figure (SVG)"
MARKDOWN = "a Markdown file"
C_HEADER = "a C header"
CSV = "a table (CSV)"
PARQUET = "a table (Parquet)"
ARRAYS = "arrays (.npz)"
ESTIMATOR = "an estimator (.npz)"
UNKNOWN = "a file of an unknown kind"

MAGIC = {
    b"\x89MCAP0\r\n": RECORDING,
    b"\x89PNG\r\n": "a picture (PNG)",
    b"\x89HDF\r\n": "an HDF5 file",
    b"%PDF": "a PDF file",
    b"PAR1": PARQUET,
    b"MATLAB 5": "a MATLAB file",
    b"\x1f\x8b": "a compressed file (gzip)",
    b"\xfd7zXZ": "a compressed file (xz)",
    b"\x28\xb5\x2f\xfd": "a compressed file (zstd)",
}
"""First bytes of formats that are no text."""

OPENINGS = {
    "<!doctype html": HTML,
    "<html": HTML,
    "<svg": SVG,
    "<?xml": SVG,
    "#pragma": C_HEADER,
    "#ifndef": C_HEADER,
    "/*": C_HEADER,
    "//": C_HEADER,
    "# ": MARKDOWN,
    "## ": MARKDOWN,
    "| ": MARKDOWN,
}
"""First letters of formats that are text, in lower case; tried after TOML and JSON."""


def kind_of(content: bytes) -> str:
    """Return the kind of file a content is, in words for people."""
    for magic, kind in MAGIC.items():
        if content.startswith(magic):
            return kind
    if content.startswith(b"PK\x03\x04"):
        return _kind_of_archive(content)
    try:
        text = content.decode("utf-8-sig").lstrip()
    except UnicodeDecodeError:
        return UNKNOWN
    return _kind_of_text(text)


def _kind_of_archive(content: bytes) -> str:
    try:
        names = zipfile.ZipFile(io.BytesIO(content)).namelist()
    except zipfile.BadZipFile:
        return "a damaged archive"
    if "schema.npy" in names:
        return ESTIMATOR
    return ARRAYS if all(n.endswith(".npy") for n in names) else "an archive (zip)"


def _kind_of_text(text: str) -> str:
    if text.startswith(("{", "[{", '["')):
        return _kind_of_json(text)
    try:
        return _kind_of_toml(tomllib.loads(text))
    except tomllib.TOMLDecodeError:
        pass
    head = text[:20].lower()
    for opening, kind in OPENINGS.items():
        if head.startswith(opening):
            return kind
    first, _, _ = text.partition("\n")
    is_table = "," in first and any(letter.isalpha() for letter in first)
    return CSV if is_table else "a text file"


def _kind_of_json(text: str) -> str:
    try:
        whole = json.loads(text)
    except ValueError:
        first, _, _ = text.partition("\n")
        if first == text:
            return "a text file"
        return _kind_of_json(first)  # one object a line
    if not isinstance(whole, dict):
        return JSON
    if "schema" in whole:
        return f"{JSON} of {whole['schema']}"
    if "config_sha256" in whole:
        return CAMPAIGN
    return LEDGER if "seal" in whole else JSON


def _kind_of_toml(table: dict[str, Any]) -> str:
    if not table:
        return MARKDOWN  # nothing but lines that begin with '#': a heading
    if str(table.get("schema", "")).startswith("rig.model"):
        return MODEL
    return PROTOCOL if "runs" in table else TOML
