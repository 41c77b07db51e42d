"""Output of studies: a folder that is created before the study runs, and tables as CSV and JSON."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from dropspin.comparisons.results.output import unfinished_folder
from dropspin.scenarios import DropspinError

SECTION = "section.json"
"""The file from which a report reads a study."""


@contextmanager
def folder_made(folder: str) -> Iterator[Path]:
    """An empty folder for the files of a study, which are moved to the study's folder at the end.

    The study's folder is created before the study runs, so that a folder that cannot be written is reported at once. After an error or an
    interrupt, the files of an earlier study are unchanged, and created folders that are empty are removed.

    Raises:
        DropspinError: The folder or a file in it cannot be written.
    """
    if not folder:
        raise DropspinError("-o: got an empty name; give the name of a folder.")
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
    """Move files to a folder. The section, from which a report reads the study, is moved last."""
    files = sorted(new.iterdir(), key=lambda file: file.name == SECTION)
    if files and files[-1].name == SECTION:
        (folder / SECTION).unlink(missing_ok=True)
    for file in files:
        file.replace(folder / file.name)


def write_table(folder: Path, stem: str, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as CSV, and as JSON, in which numbers stay numbers."""
    with (folder / f"{stem}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    (folder / f"{stem}.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
