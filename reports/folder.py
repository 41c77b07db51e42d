"""A run's folder, written whole or not at all."""

import shutil
import tempfile
from pathlib import Path

from comparisons import Results
from comparisons.store import save
from reports.html import html_report, markdown_report, svg_plots
from scenarios import DropspinError


def write(results: Results, folder: str | Path) -> Path:
    """Write a run: its data, the reports and the plots. An earlier run in the same folder is replaced.

    Args:
        results: The run.
        folder: Where to; made if it does not exist.

    Returns:
        The path of report.html.

    Raises:
        DropspinError: The folder holds something that is not a run, or cannot be written.
    """
    target = Path(folder)
    assert_replaceable(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    except OSError as error:
        raise DropspinError(f"{target}: cannot be written: {error.strerror}; choose another folder with -o.") from None
    try:
        unfinished.chmod(0o755)
        save(results, unfinished)
        results.frame.to_csv(unfinished / "results.csv", index=False)
        (unfinished / "plots").mkdir()
        plots = dict(svg_plots(results))
        for name, text in plots.items():
            (unfinished / "plots" / f"{name}.svg").write_text(text, encoding="utf-8")
        (unfinished / "report.html").write_text(html_report(results, plots), encoding="utf-8")
        (unfinished / "report.md").write_text(markdown_report(results), encoding="utf-8")
        if target.exists():
            shutil.rmtree(target)
        unfinished.rename(target)
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise
    return target / "report.html"


def assert_replaceable(folder: str | Path) -> None:
    """Raise `DropspinError` if writing a run there would destroy something else."""
    target = Path(folder)
    if target.is_dir() and any(target.iterdir()) and not (target / "run.json").is_file():
        raise DropspinError(f"{target}: holds files that are no run of dropspin; choose an empty or new folder with -o.")
    if target.exists() and not target.is_dir():
        raise DropspinError(f"{target}: is a file; choose a folder with -o.")
