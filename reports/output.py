"""Output of studies: a folder that is created before the work, and tables as CSV and JSON."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from comparisons.results.output import unfinished_folder
from scenarios import DropspinError

SECTION = "section.json"
"""The file of a study that a report includes."""


@contextmanager
def folder_made(folder: str) -> Iterator[Path]:
    """An empty folder in which to write the files of a study; at the end they take their places in the study's folder.

    The folder is created before the work, so that one that cannot be written fails then. An error or an interrupt leaves the files of an
    earlier study as they were. On leaving, created folders that stayed empty are removed.

    Raises:
        DropspinError: The folder or a file in it cannot be written.
    """
    path = Path(folder)
    made: list[Path] = []
    try:
        made = [one for one in (path, *path.parents) if not one.exists()]
        path.mkdir(parents=True, exist_ok=True)
        with unfinished_folder(path) as unfinished:
            new = unfinished / "new"
            new.mkdir()
            yield new
            _move_all(new, path)
    except OSError as error:
        raise DropspinError(f"{folder}: cannot be written: {error.strerror or error}; choose another folder with -o.") from None
    finally:
        for one in made:
            with suppress(OSError):  # it holds the tables, or other files
                one.rmdir()


def _move_all(new: Path, folder: Path) -> None:
    """Move files to a folder. The section, from which a report takes the study, is absent until the others have been moved."""
    files = sorted(new.iterdir(), key=lambda file: file.name == SECTION)
    if files and files[-1].name == SECTION:
        (folder / SECTION).unlink(missing_ok=True)
    for file in files:
        file.replace(folder / file.name)


def write_table(folder: Path, stem: str, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows twice: as CSV, and as JSON with numbers as numbers."""
    with (folder / f"{stem}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    (folder / f"{stem}.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
