"""Folders and files: output that is complete or absent, and reading what somebody else may have written.

Output is written beside its place, which it takes at the end, in a folder that holds a lock. A killed process leaves that folder; the next
one that writes the same output removes it, unless its owner lives.
"""

import glob
import hashlib
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from filelock import FileLock, Timeout

if sys.platform != "win32":
    import fcntl

from dropspin.comparisons.results.interrupts import interrupts_deferred
from dropspin.scenarios import DropspinError

NEW, OLD = "new", "old"
"""In an unfinished folder: the new output, and the earlier one while the new one takes its place."""
_UNFINISHED = "unfinished-"
_LOCK = ".lock"
_SUFFIX = 8
"""Characters that `mkdtemp` adds to a name."""
LONGEST_NAME = 60
SECTION = "section.json"
"""The file of a study's folder from which a report reads the study; it is complete if the others are."""


@contextmanager
def written_whole(file: str | Path, remedy: str = "choose another file", place: Path | None = None) -> Iterator[Path]:
    """A path to write a file to. It takes the place of the file at the end: an error or an interrupt leaves an earlier file as it was.

    A link stays a link. The folder of the file is created if it does not exist. A file with its name is complete even after a power cut.

    Args:
        file: The file.
        remedy: What to do if it cannot be written, for the message.
        place: The folder in which it is written, for many files that are written once each: what is left of one is removed with the next.

    Raises:
        DropspinError: The file cannot be written, or is a device or a pipe.
    """
    target = Path(os.path.realpath(file))

    def verify() -> None:
        if target.exists() and not target.is_file():
            raise DropspinError(f"{file}: is {'a folder' if target.is_dir() else 'not a regular file'}; choose another file.")

    with _unfinished(file, place or target.parent, "" if place else target.name, remedy, verify) as folder:
        unfinished = folder / NEW / target.name
        yield unfinished
        if target.exists():
            unfinished.chmod(target.stat().st_mode)
        with unfinished.open("rb") as written:
            os.fsync(written.fileno())
        target.parent.mkdir(parents=True, exist_ok=True)
        unfinished.replace(target)


@contextmanager
def replaced_folder(folder: str | Path, ours: Callable[[Path], set[str]], command: str) -> Iterator[Path]:
    """An empty temporary folder, which replaces the requested folder if the block succeeds, and is deleted otherwise.

    Args:
        folder: The requested folder.
        ours: The paths, within a folder, that the command wrote there.
        command: The command.

    Raises:
        DropspinError: The requested folder holds files that are not of the command, or cannot be written; raised on entering the block.
    """
    target = Path(os.path.realpath(folder))
    verify = partial(_assert_replaceable, folder, target, ours, command)
    remedy = "the folder is unchanged" if os.path.isdir(target) else "choose another folder"
    with _unfinished(folder, target.parent, target.name, remedy, verify) as beside:
        if target.exists():
            (beside / NEW).chmod(target.stat().st_mode)
        yield beside / NEW
        verify()
        try:
            if target.exists():
                target.rename(beside / OLD)
            (beside / NEW).rename(target)
        except BaseException:
            if (beside / OLD).exists() and not target.exists():
                (beside / OLD).rename(target)
            raise


def _assert_replaceable(given: str | Path, target: Path, ours: Callable[[Path], set[str]], command: str) -> None:
    """Raise `DropspinError` if writing an output there would delete files that are not of the command."""
    if not target.exists():
        return
    if not target.is_dir():
        raise DropspinError(f"{given}: this is a file; choose a folder.")
    if target == Path.cwd() or target in Path.cwd().parents or os.path.ismount(target):
        raise DropspinError(f"{given}: the working directory and mount points cannot be replaced; choose a folder inside it.")
    strangers = sorted({str(path.relative_to(target)) for path in target.rglob("*")} - ours(target))
    if strangers:
        raise DropspinError(
            f"{given}: has files that dropspin {command} did not write, such as {strangers[0]!r}; "
            "move them, or choose an empty or new folder."
        )


@contextmanager
def study_folder(folder: str) -> Iterator[Path]:
    """An empty folder for the files of a study, which are moved to the study's folder at the end.

    The study's folder is created before the study runs, so that a folder that cannot be written is reported at once. After an error or an
    interrupt, the files of an earlier study are unchanged, and created folders that are empty are removed.

    Raises:
        DropspinError: The folder or a file in it cannot be written.
    """
    if not folder:
        raise DropspinError("-o: got an empty name; give the name of a folder.")
    place = Path(folder)
    with _unfinished(folder, place, "", "choose another folder with -o") as inside:
        yield inside / NEW
        files = sorted((inside / NEW).iterdir(), key=lambda file: file.name == SECTION)
        if files and files[-1].name == SECTION:
            (place / SECTION).unlink(missing_ok=True)
        for file in files:
            if file.is_dir():
                shutil.rmtree(place / file.name, ignore_errors=True)
            file.replace(place / file.name)


@contextmanager
def _unfinished(given: str | Path, place: Path, name: str, remedy: str, verify: Callable[[], None] = lambda: None) -> Iterator[Path]:
    """An unfinished folder with an empty folder for the new output; of the folders created for it, those that stay empty are removed."""
    created: list[Path] = []
    try:
        verify()
        created = [folder for folder in (place, *place.parents) if not folder.exists()]
        place.mkdir(parents=True, exist_ok=True)
        with unfinished_folder(place, name) as folder:
            (folder / NEW).mkdir()
            yield folder
    except OSError as error:
        raise DropspinError(f"{given}: cannot be written: {error.strerror or error}; {remedy}.") from error
    finally:
        for folder in created:
            with suppress(OSError):  # it holds the output, or other files
                folder.rmdir()


@contextmanager
def unfinished_folder(place: Path, name: str = "") -> Iterator[Path]:
    """An empty folder for output that is not complete; it is removed at the end of the block.

    Args:
        place: The folder in which it is created, on the file system of the output.
        name: The name of the output, if there are several in that place.

    Raises:
        OSError: It cannot be created.
    """
    prefix = f".{name[:100]}-{_UNFINISHED}" if name else f".{_UNFINISHED}"
    for left in place.glob(f"{glob.escape(prefix)}{'?' * _SUFFIX}"):
        _remove_if_abandoned(left, place / name)
    with ExitStack() as removal:
        with interrupts_deferred():
            folder, lock = _locked_folder(place, prefix)
            removal.callback(_remove, folder, lock)
        yield folder


@contextmanager
def one_at_a_time(path: str | Path) -> Iterator[None]:
    """Let one process at a time read, change and write a file; others wait, where the system can lock the file's folder."""
    place = Path(os.path.realpath(path)).parent
    with ExitStack() as at_end:
        if sys.platform != "win32":
            with suppress(OSError):  # a file system without locks, or a folder that this user cannot read
                folder = os.open(next(parent for parent in (place, *place.parents) if parent.is_dir()), os.O_RDONLY)
                at_end.callback(os.close, folder)
                fcntl.flock(folder, fcntl.LOCK_EX)
        yield


def is_unfinished(name: str) -> bool:
    """Whether a file or folder has the name of one that a killed process may have left."""
    return name.startswith(".") and _UNFINISHED in name


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
    # Unless its owner lives, or nobody can tell.
    with suppress(Timeout, NotImplementedError, OSError), FileLock(left / _LOCK, blocking=False):
        if (left / OLD).exists() and not target.exists():
            (left / OLD).rename(target)
        shutil.rmtree(left, ignore_errors=True)


def read_stored(folder: Path, name: str) -> bytes:
    """The content of a file in a folder that somebody else may have written.

    Raises:
        ValueError: It is not a regular file: reading a pipe or a device could last for ever.
        OSError: It cannot be read.
    """
    path = folder / name
    path.stat()  # raises the error of an absent file
    if not path.is_file():
        raise ValueError(f"{name} is not a regular file")
    return path.read_bytes()


def sha256(content: bytes) -> str:
    """The SHA-256 of a content, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def file_name(text: str) -> str:
    """A text, such as the name of a scene, as a file name without its ending: different texts have different names.

    A text that any file system accepts is its own name; of another, the other characters are replaced and a hash is added.
    """
    if len(text) <= LONGEST_NAME and re.fullmatch(r"[A-Za-z0-9=][A-Za-z0-9.=_-]*", text):
        return text
    kept = re.sub(r"[^A-Za-z0-9.=]+", "-", text).strip("-.")[:LONGEST_NAME]
    return f"{kept}-{sha256(text.encode(errors='surrogatepass'))[:8]}".lstrip("-")
