"""Output of studies: a folder that is created before the work, and tables as CSV and JSON."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import Any

from scenarios import DropspinError


@contextmanager
def folder_made(folder: str) -> Iterator[Path]:
    """Create a folder to write into, so that one that cannot be written fails before the work and not after it.

    On leaving, created folders that stayed empty are removed.

    Raises:
        DropspinError: On entering, if the folder cannot be created or written.
    """
    path = Path(folder)
    made: list[Path] = []
    try:
        try:
            made = [one for one in (path, *path.parents) if not one.exists()]
            path.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=path):
                pass
        except OSError as error:
            raise DropspinError(f"{folder}: cannot be written: {error.strerror}; choose another folder with -o.") from None
        yield path
    finally:
        for one in made:
            with suppress(OSError):  # it holds the tables, or other files
                one.rmdir()


@contextmanager
def written_whole(file: str | Path) -> Iterator[Path]:
    """A path to write a file to. It takes the place of the file at the end: an error or an interrupt leaves an earlier file as it was.

    Raises:
        DropspinError: The file cannot be written.
    """
    try:
        with TemporaryDirectory(prefix=".unfinished-", dir=Path(file).parent) as folder:
            unfinished = Path(folder) / Path(file).name
            yield unfinished
            unfinished.replace(file)
    except OSError as error:
        raise DropspinError(f"{file}: cannot be written: {error.strerror or error}; choose another file.") from None


def write_table(folder: Path, stem: str, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows twice: as CSV, and as JSON with numbers as numbers."""
    with (folder / f"{stem}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    (folder / f"{stem}.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
