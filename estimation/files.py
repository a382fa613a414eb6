"""Atomic writing of files: a reader gets the old or the new content, never a part."""

import os
import tempfile
from pathlib import Path


def write_text_atomic(path: Path, text: str) -> None:
    """Write a text file under a temporary name in the target's folder and rename it.

    Args:
        path: Target; its folder is made when it is missing.
        text: Content, written as UTF-8.

    Raises:
        OSError: The folder cannot be made or written.
    """
    write_bytes_atomic(path, text.encode("utf-8"))


def write_bytes_atomic(path: Path, content: bytes) -> None:
    """Write a file under a temporary name in the target's folder and rename it.

    Args:
        path: Target; its folder is made when it is missing.
        content: All of it.

    Raises:
        OSError: The folder cannot be made or written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.chmod(0o644)  # mkstemp keeps its file private
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
