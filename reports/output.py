"""What a study leaves behind: a folder that is there before the work, and tables as CSV and JSON."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from scenarios import DropspinError


@contextmanager
def folder_made(folder: str) -> Iterator[Path]:
    """A folder to write into, made now, so that one that cannot be written fails before the work and not after it.

    On leaving, what was made and stayed empty goes again.

    Raises:
        DropspinError: On entering, if it cannot be made, or nothing can be written there.
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
            with suppress(OSError):  # it holds the tables, or somebody else's
                one.rmdir()


def write_table(folder: Path, stem: str, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows twice: as CSV, and as JSON with numbers as numbers."""
    with (folder / f"{stem}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    (folder / f"{stem}.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
