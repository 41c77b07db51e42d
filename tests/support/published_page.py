"""The output of `dropspin reproduce` on the page docs/published.md; as a program, it writes the page."""

import sys
import tempfile
from pathlib import Path

from support.cli import dropspin

PAGE = Path(__file__).parents[2] / "docs/published.md"
START, END = "<!-- output -->", "<!-- end -->"


def output_of(*names: str) -> str:
    """What the command writes for some sources, or all, without the title."""
    with tempfile.TemporaryDirectory() as folder:
        done = dropspin("reproduce", *names, cwd=folder)
        sys.stdout.write(done.stdout[-200:])
        return (Path(folder) / "out/reproduce/reproduce.md").read_text(encoding="utf-8").partition("\n")[2]


def main() -> None:
    """Write the output into the page."""
    head, _, rest = PAGE.read_text(encoding="utf-8").partition(START)
    PAGE.write_text(f"{head}{START}\n{output_of()}{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()
