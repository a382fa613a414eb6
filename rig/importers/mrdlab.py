"""Import the logs of the MRDLab rig (O'Neill et al. 2018; MRDLab/mis-tool-characterization).

A path may be one `.TXT` log, a folder of logs, a folder of such folders, or a tar archive of any of
these. Runs load when asked. What the columns become is described in `mrdlab_run`.
"""

from functools import partial
from pathlib import Path

from estimation.campaign import Campaign, Run
from rig.errors import DataError
from rig.importers.archive import first_texts, is_archive, unpack_text
from rig.importers.mrdlab_run import load_run
from rig.importers.mrdlab_text import looks_like_log
from rig.importers.registry import files_below

FIRST_BYTES = 4096


class MrdlabImporter:
    """Importer of the MRDLab text format."""

    name = "mrdlab"
    description = "MRDLab grasper rig, 1 kHz text: a .TXT log, a folder of them, or a tar archive"

    def recognises(self, path: Path) -> bool:
        """Whether the path is or holds an MRDLab log, from names and first lines only."""
        if path.is_dir():
            return any(looks_like_log(_first_bytes(file)) for file in _texts(path))
        if is_archive(path):
            return any(map(looks_like_log, first_texts(path, FIRST_BYTES)))
        return _is_text(path) and looks_like_log(_first_bytes(path))

    def open(self, path: Path) -> Campaign:
        """Open a log, a folder or an archive as a campaign, in file order.

        Runs are named by file stem, `folder/stem` where the logs lie in more than one folder.
        A read-me in the folder of the logs becomes part of the notes.

        Raises:
            DataError: No log was found, or the archive is damaged. Reading a run raises DataError
                where its file is damaged, naming file, line and what was expected.
        """
        if path.is_dir():
            return _campaign(path, path, _logs(path))
        if is_archive(path):
            folder = unpack_text(path)
            return _campaign(path, folder, _logs(folder))
        return _campaign(path, path.parent, [path])


IMPORTER = MrdlabImporter()


def _campaign(path: Path, root: Path, logs: list[Path]) -> Campaign:
    if not logs:
        raise DataError(
            f"{path} holds no MRDLab log.",
            "Expected .TXT files that start with % header lines, or named by digits.",
            "Give the folder the logs lie in.",
        )
    several = len({log.parent for log in logs}) > 1
    inside = is_archive(path)
    companions = {folder: _companions(folder) for folder in {log.parent for log in logs}}
    runs = []
    for log in logs:
        name = f"{log.parent.name}/{log.stem}" if several else log.stem
        # inside an archive, name the archive, which is the user's file
        source = f"{path}:{log.relative_to(root).as_posix()}" if inside else str(log)
        load = partial(load_run, log, name, source, companions[log.parent])
        runs.append(Run(name, load, path if inside else log))
    return Campaign(tuple(runs))


def _logs(root: Path) -> list[Path]:
    """Return the logs under a folder in file order.

    A file named by digits alone is meant to be one, so it is listed even when it does not start
    with `%`, and reading it reports the fault.
    """
    return [file for file in _texts(root) if file.stem.isdigit() or _first_bytes(file)[:1] == b"%"]


def _texts(root: Path) -> list[Path]:
    return [file for file in files_below(root) if _is_text(file)]


def _is_text(path: Path) -> bool:
    return path.suffix.lower() == ".txt" and path.is_file()


def _first_bytes(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(FIRST_BYTES)


def _companions(folder: Path) -> str:
    texts = [
        file.read_text("latin-1").strip()
        for file in sorted(folder.iterdir())
        if _is_text(file) and file.stem.lower() == "readme" and file.stat().st_size < 1 << 16
    ]
    return "\n".join(texts)
