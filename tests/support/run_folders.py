"""Folders of runs that were changed by somebody who knows the format: all checksums are right."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from dropspin.comparisons.results.run_file import FILE, TABLE, signed


def contents(folder: Path) -> dict[str, bytes]:
    """All files below a folder, by path."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def change_json(folder: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change the content of run.json, and sign it."""
    content = json.loads((folder / FILE).read_text(encoding="utf-8"))
    change(content)
    if isinstance(content.get("sha256"), dict):
        content["sha256"].pop(FILE, None)
        (folder / FILE).write_text(signed(content), encoding="utf-8")
    else:
        (folder / FILE).write_text(json.dumps(content), encoding="utf-8")


def replace_file(folder: Path, name: str, content: bytes) -> None:
    """Replace a file that has a checksum, and sign the folder."""
    (folder / name).write_bytes(content)
    change_json(folder, lambda stored: stored["sha256"].update({name: hashlib.sha256(content).hexdigest()}))


def change_table(folder: Path, change: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    """Change the table, and sign the folder."""
    change(pd.read_parquet(folder / TABLE)).to_parquet(folder / "new.parquet", index=False)
    replace_file(folder, TABLE, (folder / "new.parquet").read_bytes())
    (folder / "new.parquet").unlink()
