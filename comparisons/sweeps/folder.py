"""The folder of a sweep: `sweep.json`, and the table in parts, each written completely or not at all.

On a disk a part gets its name when it is complete; an object store receives a part in one request.
"""

import io
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import fsspec
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from fsspec.implementations.local import LocalFileSystem
from pydantic import AliasPath, BaseModel, ConfigDict, Field, ValidationError

from dropspin.comparisons.results.complete_folders import is_unfinished, written_whole
from dropspin.comparisons.results.table import schema_of, stored_table
from dropspin.comparisons.sweeps.outcomes import STANDARD_METRICS
from dropspin.scenarios import DropspinError
from dropspin.scenarios.state import STATE_COLUMNS

DESCRIPTION = "sweep.json"
PARTS_PER_FOLDER = 1000
"""File systems are slow with many files in one folder."""
TEXTS = ("key", "scene", "engine", "verdict", "reason")
NUMBERS = ("dt", "time_per_step", *STANDARD_METRICS, *STATE_COLUMNS)
SCHEMA = schema_of((*TEXTS, "job", "seed", "steps"), NUMBERS)
"""The columns of every sweep; axes and requested metrics add others, of numbers or texts."""


class Description(BaseModel):
    """The required content of `sweep.json`."""

    model_config = ConfigDict(strict=True)

    identity: Annotated[str, Field(pattern="^[0-9a-f]{12}$")]
    jobs: Annotated[int, Field(ge=0, le=2**53)]
    part_size: Annotated[int, Field(ge=1, le=2**53)]
    versions: Annotated[dict[str, str | None], Field(validation_alias=AliasPath("provenance", "versions"))]


class SweepFolder:
    """The folder that holds the table of a sweep: a path, or a URL that fsspec supports.

    Args:
        where: The path or URL.
        identity: A hash of the sweep and of the versions it is run with, which is part of the file names; any by default.
        part_size: The number of jobs of a part that is written, or of all but the last.
    """

    def __init__(self, where: str, identity: str = "", part_size: int = 1) -> None:
        self.where = where
        try:
            self._files, self._root = fsspec.core.url_to_fs(where)
        except (ImportError, ValueError) as error:
            raise DropspinError(f"-o {where}: {error}; give a folder, or a URL of a file system that fsspec supports here.") from None
        self._identity, self._part_size = identity, part_size

    @property
    def address(self) -> str:
        """The location as a URL that is valid on other machines."""
        return str(self._files.unstrip_protocol(self._root))

    def description(self) -> Description | None:
        """The content of `sweep.json`; None if there is no such file.

        Raises:
            DropspinError: The folder holds something else.
        """
        file = f"{self._root}/{DESCRIPTION}"
        try:
            text = self._files.cat_file(file) if self._files.isfile(file) or not self._files.exists(file) else b""  # a pipe could block
            return Description.model_validate_json(text)
        except FileNotFoundError:
            if not self._files.exists(self._root):
                return None
            if self._files.isdir(self._root):
                names = map(os.path.basename, self._files.ls(self._root, detail=False))
                if all(map(is_unfinished, names)):  # left by a sweep that was killed at its beginning
                    return None
            fault = "holds files that do not belong to a sweep; choose an empty or new folder"
        except NotADirectoryError:
            fault = "is a file, or inside one; choose a folder"
        except ValidationError:
            fault = f"its {DESCRIPTION} is not a valid description of a sweep; choose an empty or new folder"
        raise DropspinError(f"{self.where}: {fault} with -o.")

    def begin(self, description: dict[str, Any]) -> None:
        """Write `sweep.json`."""
        self._put(DESCRIPTION, json.dumps({"identity": self._identity, **description}, indent=1, default=str).encode())

    def write(self, jobs: range, table: pa.Table) -> None:
        """Write a part: the table of the jobs with these numbers."""
        content = io.BytesIO()
        pq.write_table(table, content, compression="zstd", write_page_checksum=True)
        self._put(self._name(jobs), content.getvalue())

    def has(self, jobs: range) -> bool:
        """Whether the folder has a part."""
        return bool(self._files.exists(f"{self._root}/{self._name(jobs)}"))

    def parts(self) -> dict[range, str]:
        """The paths of the parts, by the numbers of their jobs, in order."""
        self._files.invalidate_cache()
        pattern = re.compile(rf"(\d{{16}})-(\d{{16}})-{self._identity or '[0-9a-f]{12}'}\.parquet")
        matches = {path: pattern.fullmatch(os.path.basename(path)) for path in self._files.find(f"{self._root}/parts", withdirs=True)}
        parts = {range(int(match[1]), int(match[2])): path for path, match in matches.items() if match}
        return dict(sorted(parts.items(), key=lambda part: part[0].start))

    def read(self, jobs: range, path: str, columns: list[str] | None = None) -> pa.Table:
        """Read a part.

        Raises:
            DropspinError: It is damaged, or not a part of a sweep.
        """
        try:
            if not self._files.isfile(path):  # reading a pipe could last for ever
                raise ValueError("is not a regular file")
            needed = None if columns is None else {"job", "verdict", *columns}
            table = stored_table(self._files.cat_file(path), SCHEMA, with_others=True, only=needed)
            if len(table) != len(jobs) or table["job"].to_pylist() != list(jobs):
                raise ValueError("has other jobs than its name")
            return table if columns is None else table.select(columns)
        except Exception:  # whatever pyarrow raises for a file that is none
            raise DropspinError(f"{path}: is damaged; delete it, and run its jobs again with --resume.") from None

    def _name(self, jobs: range) -> str:
        folder = jobs.start // (PARTS_PER_FOLDER * self._part_size)
        return f"parts/{folder:06d}/{jobs.start:016d}-{jobs.stop:016d}-{self._identity}.parquet"

    def _put(self, name: str, content: bytes) -> None:
        path, remedy = f"{self._root}/{name}", "the parts written so far are complete: --resume continues the sweep"
        if isinstance(self._files, LocalFileSystem):
            with written_whole(path, remedy, Path(self._root)) as unfinished:
                unfinished.write_bytes(content)
            return
        try:
            self._files.pipe_file(path, content)
        except OSError as error:
            raise DropspinError(f"{path}: cannot be written: {error.strerror or error}; {remedy}.") from None


def written_parts(where: str) -> tuple[SweepFolder, dict[range, str]]:
    """The folder of a sweep, and its parts by the numbers of their jobs.

    Raises:
        DropspinError: It does not hold a sweep.
    """
    about = SweepFolder(where).description()
    if about is None:
        raise DropspinError(f"{where}: does not hold a sweep; give the folder that dropspin sweep -o wrote.")
    folder = SweepFolder(where, about.identity)
    return folder, folder.parts()


def count(where: str) -> int:
    """The number of jobs that a folder has; 0 if it holds no sweep."""
    return sum(map(len, written_parts(where)[1])) if SweepFolder(where).description() is not None else 0


def read_sweep(where: str) -> pd.DataFrame:
    """The table of a sweep, in the order of its jobs; if the sweep is unfinished, with the jobs that have been run.

    Args:
        where: The folder, or a URL that fsspec supports.

    Returns:
        One row for each job.

    Raises:
        DropspinError: The folder does not hold a sweep, none of its jobs has been run, or a part is damaged.
    """
    tables = list(read_sweep_parts(where))
    if not tables:
        raise DropspinError(f"{where}: no job has been run yet; run the sweep with --resume.")
    return pa.concat_tables(tables).to_pandas()


def read_sweep_parts(where: str, columns: list[str] | None = None) -> Iterator[pa.Table]:
    """The table of a sweep part by part, for tables that are larger than memory.

    Args:
        where: The folder, or a URL that fsspec supports.
        columns: Names of the columns to read; None for all.

    Returns:
        An iterator over the parts, in the order of the jobs, each a PyArrow table.

    Raises:
        DropspinError: The folder does not hold a sweep, or a part is damaged.
    """
    folder, parts = written_parts(where)
    schema = None
    for jobs, path in parts.items():
        table = folder.read(jobs, path, columns)
        schema = schema or table.schema
        if table.schema != schema:
            raise DropspinError(f"{path}: has other columns than the parts before it; delete it, and run its jobs again with --resume.")
        yield table
