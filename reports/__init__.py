"""What a person or a CI reads: tables, plots, HTML, files, and the command line."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from reports.folder import write
    from reports.tables import print_table

__all__ = ["print_table", "write"]

_HOMES = {"write": "reports.folder", "print_table": "reports.tables"}


def __getattr__(name: str) -> Any:
    """Import on first use: the command line must not wait for pandas to print its help."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'reports' has no attribute {name!r}")
