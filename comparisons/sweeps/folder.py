"""The folder of a sweep: `sweep.json`, and the table in parts, each written completely or not at all.

On a disk a part gets its name when it is complete; an object store receives a part in one request.
"""

import io
import json
import os
import re
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import fsspec
import pyarrow as pa
import pyarrow.parquet as pq
from fsspec.implementations.local import LocalFileSystem
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dropspin.comparisons.judging.verdicts import VERDICTS
from dropspin.comparisons.results.output import UNFINISHED, unfinished_folder
from dropspin.comparisons.sweeps.outcomes import STANDARD_METRICS, STATE_COLUMNS
from dropspin.scenarios import DropspinError

DESCRIPTION = "sweep.json"
PARTS_PER_FOLDER = 1000
"""File systems are slow with many files in one folder, and so is listing it."""


COLUMNS = MappingProxyType(
    dict.fromkeys(("key", "scene", "engine", "verdict", "reason"), pa.string())
    | dict.fromkeys(("job", "seed", "steps"), pa.int64())
    | dict.fromkeys(("dt", "time_per_step", *STANDARD_METRICS, *STATE_COLUMNS), pa.float64())
)
"""The columns of every sweep; axes and requested metrics add others, of numbers or texts."""


class _Versions(BaseModel):
    model_config = ConfigDict(strict=True)

    versions: dict[str, str | None]


class Description(BaseModel):
    """The required content of `sweep.json`."""

    model_config = ConfigDict(strict=True)

    identity: Annotated[str, Field(pattern="^[0-9a-f]{12}$")]
    jobs: Annotated[int, Field(ge=0, le=2**53)]
    part_size: Annotated[int, Field(ge=1, le=2**53)]
    provenance: _Versions


class SweepFolder:
    """The folder that holds the table of a sweep: a path, or a URL that fsspec supports.

    Args:
        where: The path or URL.
        identity: A hash of the sweep and of the versions it is run with; it is part of the file names.
    """

    def __init__(self, where: str, identity: str = "") -> None:
        self.where, self._identity = where, identity
        try:
            self._files, self._root = fsspec.core.url_to_fs(where)
        except (ImportError, ValueError) as error:
            raise DropspinError(f"-o {where}: {error}; give a folder, or a URL of a file system that fsspec supports here.") from None
        self._is_local = isinstance(self._files, LocalFileSystem)

    @property
    def address(self) -> str:
        """The location as a URL that is valid on other machines."""
        return str(self._files.unstrip_protocol(self._root))

    def description(self) -> dict[str, Any] | None:
        """The content of `sweep.json`; None if there is no such file.

        Raises:
            DropspinError: The folder holds something else.
        """
        file = f"{self._root}/{DESCRIPTION}"
        try:
            text = self._files.cat_file(file) if self._files.isfile(file) or not self._files.exists(file) else b""  # a pipe could block
        except FileNotFoundError:
            if self._files.exists(self._root) and (not self._files.isdir(self._root) or self._holds_other_files()):
                raise DropspinError(
                    f"{self.where}: holds files that do not belong to a sweep; choose an empty or new folder with -o."
                ) from None
            return None
        except NotADirectoryError:
            raise DropspinError(f"{self.where}: is a file, or inside one; choose a folder with -o.") from None
        try:
            return Description.model_validate_json(text).model_dump()
        except ValidationError:
            raise DropspinError(
                f"{self.where}: its {DESCRIPTION} is not a valid description of a sweep; choose an empty or new folder with -o."
            ) from None

    def _holds_other_files(self) -> bool:
        """Whether there is any file but those that a sweep leaves if it is killed at its beginning."""
        return any(not os.path.basename(path).startswith(f".{UNFINISHED}") for path in self._files.ls(self._root, detail=False))

    def begin(self, description: dict[str, Any]) -> None:
        """Write `sweep.json`."""
        self._put(DESCRIPTION, json.dumps({"identity": self._identity, **description}, indent=1, default=str).encode())

    def write(self, number: int, first: int, last: int, table: pa.Table) -> None:
        """Write a part: the jobs from number `first` up to, not including, `last`."""
        content = io.BytesIO()
        pq.write_table(table, content, compression="zstd", write_page_checksum=True)
        self._put(self._name(number, first, last), content.getvalue())

    def has(self, number: int, first: int, last: int) -> bool:
        """Whether the folder has a part."""
        return bool(self._files.exists(f"{self._root}/{self._name(number, first, last)}"))

    def groups(self) -> list[int]:
        """The groups of which the folder has any part, in order."""
        try:
            found = self._files.ls(f"{self._root}/parts", detail=False, refresh=True)
        except FileNotFoundError:
            return []
        return sorted(int(name) for name in map(os.path.basename, found) if name.isdecimal())

    def parts(self, group: int) -> dict[int, str]:
        """The paths of the parts of a group, by the numbers of their first jobs, in order; group k holds the parts from 1000 k on."""
        try:
            found = self._files.ls(f"{self._root}/{self._group(group)}", detail=False, refresh=True)
        except FileNotFoundError:
            return {}
        pattern = re.compile(rf"(\d{{16}})-\d{{16}}-{self._identity}\.parquet")
        paths = {int(match[1]): path for path in found if (match := pattern.fullmatch(os.path.basename(path)))}
        return dict(sorted(paths.items()))

    def read(self, path: str, columns: list[str] | None = None) -> pa.Table:
        """Read a part.

        Raises:
            DropspinError: It is damaged, or not a part of a sweep.
        """
        first, last = map(int, os.path.basename(path).split("-")[:2])
        try:
            if not self._files.isfile(path):  # reading a pipe could last for ever
                raise ValueError("is not a regular file")
            return _read_part(self._files.cat_file(path), range(first, last), columns)
        except Exception:  # whatever pyarrow raises for a file that is none
            raise DropspinError(f"{path}: is damaged; delete it, and run its jobs again with --resume.") from None

    def _name(self, number: int, first: int, last: int) -> str:
        return f"{self._group(number // PARTS_PER_FOLDER)}/{first:016d}-{last:016d}-{self._identity}.parquet"

    @staticmethod
    def _group(group: int) -> str:
        return f"parts/{group:06d}"

    def _put(self, name: str, content: bytes) -> None:
        path = f"{self._root}/{name}"
        try:
            if not self._is_local:
                self._files.pipe_file(path, content)
                return
            target = Path(path)
            target.parent.mkdir(parents=True, exist_ok=True)
            with unfinished_folder(Path(self._root)) as folder:
                unfinished = folder / "new"
                with unfinished.open("wb") as file:
                    file.write(content)
                    file.flush()
                    os.fsync(file.fileno())  # so that a part with its name is complete even after a power cut
                unfinished.replace(target)
        except OSError as error:
            raise DropspinError(
                f"{self.where}: is not writable: {error.strerror or error}; "
                "the parts written so far are complete: --resume continues the sweep."
            ) from None


def _read_part(content: bytes, jobs: range, columns: list[str] | None) -> pa.Table:
    """A part, or some of its columns, if it has those of a sweep, and these jobs."""
    # Without threads of pyarrow: engine processes are forked in the meantime, and parts are read one at a time.
    file = pq.ParquetFile(io.BytesIO(content), page_checksum_verification=True)
    types = dict(zip(file.schema_arrow.names, file.schema_arrow.types, strict=True))
    if not COLUMNS.items() <= types.items() or not {*types.values()} <= {*COLUMNS.values()}:
        raise ValueError("has other columns or types than a sweep")
    known = file.read(columns=["job", "verdict"], use_threads=False)
    if known["job"].to_pylist() != list(jobs) or not set(known["verdict"].unique().to_pylist()) <= set(VERDICTS):
        raise ValueError("has other jobs or verdicts than a sweep")
    return file.read(columns=columns, use_threads=False).replace_schema_metadata(None)
