"""What a person or a CI reads: tables, plots, HTML, files, and the command line."""

from reports.tables import print_table
from reports.write import write

__all__ = ["print_table", "write"]
