"""A sweep's folder: `sweep.json`, and the table in parts, each written whole or not at all.

On a disk a part gets its name when it is complete; an object store takes it whole in one request.
"""

import io
import json
import os
import re
from pathlib import Path
from typing import Annotated, Any

import fsspec
import pyarrow as pa
import pyarrow.parquet as pq
from fsspec.implementations.local import LocalFileSystem
from pydantic import BaseModel, Field, ValidationError

from scenarios import DropspinError

ABOUT = "sweep.json"
UNFINISHED = ".unfinished-"
TOGETHER = 1000  # parts to a folder: file systems are slow with many files in one, and so is looking at them


class About(BaseModel):
    """What `sweep.json` must say."""

    identity: str
    jobs: Annotated[int, Field(ge=0)]
    part_size: Annotated[int, Field(ge=1)]
    provenance: dict[str, Any]


class Folder:
    """Where a sweep's table is: a path, or a URL that fsspec knows.

    Args:
        where: The path or URL.
        identity: A hash of what was asked for and of the versions at work; parts bear it in their names.
    """

    def __init__(self, where: str, identity: str = "") -> None:
        self.where, self._identity = where, identity
        try:
            self._files, self._root = fsspec.core.url_to_fs(where)
        except (ImportError, ValueError) as error:
            raise DropspinError(f"-o {where}: {error}; give a folder, or a URL of a file system that fsspec has here.") from None
        self._is_local = isinstance(self._files, LocalFileSystem)

    def about(self) -> dict[str, Any] | None:
        """What `sweep.json` says, or None: there is none.

        Raises:
            DropspinError: The folder holds something else.
        """
        try:
            text = self._files.cat_file(f"{self._root}/{ABOUT}")
        except FileNotFoundError:
            if self._files.exists(self._root) and (not self._files.isdir(self._root) or self._holds_something()):
                raise DropspinError(
                    f"{self.where}: holds something that is no sweep of dropspin; choose an empty or new folder with -o."
                ) from None
            return None
        except NotADirectoryError:
            raise DropspinError(f"{self.where}: is a file, or in one; choose a folder with -o.") from None
        try:
            return About.model_validate_json(text).model_dump()
        except ValidationError:
            raise DropspinError(f"{self.where}: its {ABOUT} is none of a sweep's; choose an empty or new folder with -o.") from None

    def _holds_something(self) -> bool:
        """Anything but what a sweep leaves that was killed as it began."""
        return any(not os.path.basename(path).startswith(UNFINISHED) for path in self._files.ls(self._root, detail=False))

    def begin(self, about: dict[str, Any]) -> None:
        """Say what the folder is going to hold, and clean away what a killed sweep left half written."""
        self._put(ABOUT, json.dumps({"identity": self._identity, **about}, indent=1, default=str).encode())
        if self._is_local:
            for left in Path(self._root).rglob(f"{UNFINISHED}*"):
                left.unlink(missing_ok=True)

    def write(self, number: int, first: int, last: int, table: pa.Table) -> None:
        """Write a part: the jobs from number `first` up to, not including, `last`."""
        content = io.BytesIO()
        pq.write_table(table, content, compression="zstd")
        self._put(self._name(number, first, last), content.getvalue())

    def has(self, number: int, first: int, last: int) -> bool:
        """Whether a part is there."""
        return bool(self._files.exists(f"{self._root}/{self._name(number, first, last)}"))

    def groups(self) -> list[int]:
        """The groups of which there is any part, in order."""
        try:
            found = self._files.ls(f"{self._root}/parts", detail=False, refresh=True)
        except FileNotFoundError:
            return []
        return sorted(int(name) for name in map(os.path.basename, found) if name.isdecimal())

    def listed(self, group: int) -> dict[int, str]:
        """The parts of a group that are there, by their first jobs, in order; group k holds the parts from 1000 k on."""
        try:
            found = self._files.ls(f"{self._root}/{self._group(group)}", detail=False, refresh=True)
        except FileNotFoundError:
            return {}
        ours = re.compile(rf"(\d{{16}})-\d{{16}}-{self._identity}\.parquet")
        firsts = {int(match[1]): path for path in found if (match := ours.fullmatch(os.path.basename(path)))}
        return dict(sorted(firsts.items()))

    @property
    def address(self) -> str:
        """Where it is, seen from anywhere."""
        return str(self._files.unstrip_protocol(self._root))

    def read(self, path: str, columns: list[str] | None = None) -> pa.Table:
        """A part."""
        try:
            # Without threads of pyarrow's: processes are forked beside them, and one part is read at a time.
            return pq.read_table(io.BytesIO(self._files.cat_file(path)), columns=columns, use_threads=False, pre_buffer=False)
        except pa.ArrowInvalid:
            raise DropspinError(f"{path}: is no whole part of a sweep; delete it, and --resume does its jobs again.") from None

    def _name(self, number: int, first: int, last: int) -> str:
        return f"{self._group(number // TOGETHER)}/{first:016d}-{last:016d}-{self._identity}.parquet"

    @staticmethod
    def _group(group: int) -> str:
        return f"parts/{group:06d}"

    def _put(self, name: str, content: bytes) -> None:
        path = f"{self._root}/{name}"
        try:
            if not self._is_local:
                self._files.pipe_file(path, content)
                return
            whole = Path(path)
            whole.parent.mkdir(parents=True, exist_ok=True)
            unfinished = whole.with_name(f"{UNFINISHED}{os.getpid()}-{whole.name}")
            with unfinished.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())  # after a power cut, too, a part that has its name is whole
            unfinished.replace(whole)
        except OSError as error:
            raise DropspinError(f"{self.where}: cannot be written: {error.strerror or error}; parts that are there are whole.") from None
