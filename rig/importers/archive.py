"""Unpack the text files of a tar archive safely, once a process."""

import atexit
import shutil
import tarfile
import tempfile
import zlib
from collections.abc import Iterator
from functools import lru_cache
from lzma import LZMAError
from pathlib import Path, PurePosixPath

from rig.errors import DataError

SUFFIXES = (".tar", ".tar.xz", ".txz", ".tar.gz", ".tgz", ".tar.bz2")
MAX_MEMBER_BYTES = 1 << 30
MAX_TOTAL_BYTES = 8 << 30
MAX_MEMBERS = 100_000
FIRST_MEMBERS = 64
_DAMAGE = (tarfile.TarError, EOFError, LZMAError, zlib.error, OSError)


def is_archive(path: Path) -> bool:
    """Whether a file's name is that of a tar archive."""
    return path.is_file() and path.name.lower().endswith(SUFFIXES)


def first_texts(path: Path, size: int) -> Iterator[bytes]:
    """Yield the first bytes of each `.txt` file among the first members; damage ends it."""
    try:
        with tarfile.open(path, "r|*") as archive:
            for _, member in zip(range(FIRST_MEMBERS), archive, strict=False):
                if member.size > MAX_MEMBER_BYTES:
                    return
                if member.isfile() and member.name.lower().endswith(".txt"):
                    content = archive.extractfile(member)
                    yield content.read(size) if content else b""
    except _DAMAGE:
        return


def unpack_text(path: Path) -> Path:
    """Unpack every `.txt` file of an archive into a temporary folder and return the folder.

    The folder lives as long as the process and is shared by later calls for the same archive.

    Raises:
        DataError: The archive is damaged, too large to be a set of logs, or holds a file whose name
            leads out of the folder.
    """
    state = path.stat()
    return _unpack_text(path.resolve(), state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=64)
def _unpack_text(path: Path, _mtime_ns: int, _size: int) -> Path:
    folder = Path(tempfile.mkdtemp(prefix="rig-import-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    try:
        with tarfile.open(path, "r|*") as archive:
            _extract(path, archive, folder)
    except _DAMAGE as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise DataError(
            f"The archive {path} is damaged: {error}.",
            "It was expected to be a whole tar archive; nothing was imported from it.",
            "Copy or download it again and compare its checksum.",
        ) from error
    except DataError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder


def _extract(path: Path, archive: tarfile.TarFile, folder: Path) -> None:
    total = 0
    for count, member in enumerate(archive):
        total += member.size
        if count >= MAX_MEMBERS or member.size > MAX_MEMBER_BYTES or total > MAX_TOTAL_BYTES:
            raise DataError(
                f"The archive {path} is too large at {member.name!r} ({member.size} bytes).",
                f"Logs of at most {MAX_MEMBER_BYTES >> 20} MB a file and "
                f"{MAX_TOTAL_BYTES >> 30} GB in all are expected.",
                "Unpack it by hand and import the folder if it is what it should be.",
            )
        name = PurePosixPath(member.name)
        if name.is_absolute() or ".." in name.parts or "\\" in member.name:
            raise DataError(
                f"The archive {path} holds {member.name!r}, which leads out of its folder.",
                "Such a name is never part of a set of logs; nothing was imported.",
                "Do not trust this archive.",
            )
        if not member.isfile() or name.suffix.lower() != ".txt":
            continue
        if member.size > shutil.disk_usage(folder).free:
            raise DataError(
                f"Not enough disk space to unpack {path} in {folder.parent}.",
                fix="Free some space or set TMPDIR to a larger disk.",
            )
        content = archive.extractfile(member)
        if content is None:
            continue
        target = folder.joinpath(*name.parts)
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("wb") as out:
            shutil.copyfileobj(content, out, 1 << 20)
