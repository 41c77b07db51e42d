"""Output that is written completely or not at all: in a folder beside its place, which it takes at the end.

A killed process leaves that folder; the next one that writes the same output removes it, unless its owner, which holds a lock in it, lives.
"""

import glob
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from dropspin.comparisons.results.interrupts import interrupts_deferred
from dropspin.scenarios import DropspinError

UNFINISHED = "unfinished-"
OLD = "old"
"""In an unfinished folder: the earlier output, while the new one takes its place."""
_LOCK = ".lock"
_SUFFIX = 8
"""Characters that `mkdtemp` adds to a name."""


@contextmanager
def unfinished_folder(place: Path, name: str = "") -> Iterator[Path]:
    """An empty folder for output that is not complete; it is removed at the end of the block.

    Args:
        place: The folder in which it is created, on the file system of the output.
        name: The name of the output, if there are several in that place.

    Raises:
        OSError: It cannot be created.
    """
    prefix = f".{name[:100]}-{UNFINISHED}" if name else f".{UNFINISHED}"
    for left in place.glob(f"{glob.escape(prefix)}{'?' * _SUFFIX}"):
        _remove_if_abandoned(left, place / name)
    with ExitStack() as removal:
        with interrupts_deferred():
            folder, lock = _locked_folder(place, prefix)
            removal.callback(_remove, folder, lock)
        yield folder


def _locked_folder(place: Path, prefix: str) -> tuple[Path, FileLock]:
    """A new folder, and the lock in it that its owner holds."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=prefix, dir=place))
        lock = FileLock(folder / _LOCK)
        try:
            with suppress(NotImplementedError):  # a file system without locks: others leave the folder alone
                lock.acquire(blocking=False)
        except (Timeout, FileNotFoundError):  # another process took it for abandoned before it was locked
            continue
        if folder.exists():
            return folder, lock


def _remove(folder: Path, lock: FileLock) -> None:
    with interrupts_deferred():
        lock.release()
        shutil.rmtree(folder, ignore_errors=True)


def _remove_if_abandoned(left: Path, target: Path) -> None:
    """Remove the folder of a process that was killed; an output that it had put aside is put back."""
    if left.is_symlink() or not left.is_dir():  # a link may lead to any folder
        left.unlink(missing_ok=True)
        return
    try:
        with FileLock(left / _LOCK, blocking=False):
            if (left / OLD).exists() and not target.exists():
                (left / OLD).rename(target)
            shutil.rmtree(left, ignore_errors=True)
    except (Timeout, NotImplementedError, OSError):  # its owner lives, or nobody can tell
        return


@contextmanager
def written_whole(file: str | Path) -> Iterator[Path]:
    """A path to write a file to. It takes the place of the file at the end: an error or an interrupt leaves an earlier file as it was.

    A link stays a link. The folder of the file is created if it does not exist.

    Raises:
        DropspinError: The file cannot be written, or is a device or a pipe.
    """
    try:
        target = Path(file).resolve()
        if target.exists() and not target.is_file():
            raise DropspinError(f"{file}: is {'a folder' if target.is_dir() else 'not a regular file'}; choose another file.")
        target.parent.mkdir(parents=True, exist_ok=True)
        with unfinished_folder(target.parent, target.name) as folder:
            (folder / "new").mkdir()
            unfinished = folder / "new" / target.name
            yield unfinished
            if target.exists():
                unfinished.chmod(target.stat().st_mode)
            unfinished.replace(target)
    except OSError as error:
        raise DropspinError(f"{file}: cannot be written: {error.strerror or error}; choose another file.") from None
