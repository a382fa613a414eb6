"""Writing a file so that a reader sees the old one or the new one, never half of either.

An existing file is replaced by one of its own kind only: an output option with a slip in it must
not cost a recording.
"""

import contextlib
import os
import tempfile
from pathlib import Path

from estimation.errors import EstimationError
from estimation.file_kinds import kind_of


class OutputError(EstimationError):
    """An output cannot be written where it was asked for."""


def not_utf8(error: UnicodeDecodeError) -> tuple[str, str]:
    """Return why a text file cannot be read, with the line, and the remedy."""
    line = error.object.count(b"\n", 0, error.start) + 1
    why = f"Line {line} holds a character that is not UTF-8, such as an umlaut in Latin-1."
    return why, "Save the file as UTF-8."


def write_text_atomic(path: Path, text: str) -> None:
    """Write a text file as UTF-8, see `write_bytes_atomic`."""
    write_bytes_atomic(path, text.encode("utf-8"))


def write_bytes_atomic(path: Path, content: bytes) -> None:
    """Write a file under a temporary name in the target's folder, which is made, and rename it.

    Raises:
        OutputError: The folder cannot be made or written, or a file of another kind is there.
    """
    try:
        _refuse_other_kind(path, kind_of(content))
        part = _part_of(path)
        try:
            with part.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            part.chmod(0o644)  # mkstemp keeps its file private
            part.replace(path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise _unwritable(path, error) from error


def check_output(path: Path | None, kind: str) -> None:
    """Refuse an output that could not be written, before the work whose result it is to hold.

    Its folder is made; the kind is one of `estimation.file_kinds`. Nothing is checked without a
    path.

    Raises:
        OutputError: The folder cannot be made or written, or a file of another kind is there.
    """
    if path is None:
        return
    try:
        _refuse_other_kind(path, kind)
        _part_of(path).unlink()
    except OSError as error:
        raise _unwritable(path, error) from error


def sync_folder(folder: Path) -> None:
    """Wait until a folder's new names are on the disk."""
    with contextlib.suppress(PermissionError):  # Windows opens no folders
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _part_of(path: Path) -> Path:
    """Make the folder of a target, and an empty file under a temporary name in it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    os.close(handle)
    return Path(name)


def _refuse_other_kind(path: Path, kind: str) -> None:
    if not path.exists():
        return
    if not path.is_file():
        what = "a folder" if path.is_dir() else "a device"
        raise OutputError(f"{path} is {what}, not a file.", fix="Name a file.")
    content = path.read_bytes()
    found = kind_of(content)
    if content.strip() and found != kind:
        raise OutputError(
            f"{path} is {found}; it is not replaced by {kind}.",
            "An output replaces files of its own kind only. Nothing was written.",
            "Name another file.",
        )


def _unwritable(path: Path, error: OSError) -> OutputError:
    return OutputError(
        f"{path} cannot be written.", f"{error.strerror or error}.", "Name another file."
    )
