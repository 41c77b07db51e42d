"""A run's folder, written whole or not at all."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from comparisons.results.results import Results
from comparisons.results.store import load_results, save
from reports.html.report import html_report
from reports.junit import junit_xml
from reports.markdown import run_markdown
from reports.plots.figures import FIGURES, report_figures
from reports.plots.svg import save_png, svg
from reports.sections import Section
from scenarios import DropspinError

OURS = frozenset(
    {"run.json", "results.parquet", "results.csv", "report.html", "report.md", "replay.html", "junit.xml", "plots"}
    | {"trajectories", "ensembles"}
)


def write_report(results: Results, folder: str | Path, sections: Sequence[Section] = ()) -> Path:
    """Write a run: its data, the reports and the plots. An earlier run in the same folder is replaced.

    Args:
        results: The run.
        folder: Where to; made if it does not exist.
        sections: What other studies have to tell, for the report.

    Returns:
        The path of report.html.

    Raises:
        DropspinError: The folder holds something that is not a run, or cannot be written.
    """
    with run_folder(folder) as unfinished:
        fill(results, unfinished, sections)
    return Path(folder) / "report.html"


def fill(results: Results, folder: Path, sections: Sequence[Section] = (), png: bool = False) -> None:
    """Write everything of a run into an empty folder."""
    save(results, folder)
    results.table.to_csv(folder / "results.csv", index=False)
    (folder / "plots").mkdir()
    plots = {}
    for name, figure in report_figures(results):
        plots[name] = svg(figure, f"s{name}")
        (folder / "plots" / f"{name}.svg").write_text(plots[name], encoding="utf-8")
        if png:
            save_png(figure, folder / "plots" / f"{name}.png")
    (folder / "report.html").write_text(html_report(results, plots, sections), encoding="utf-8")
    (folder / "report.md").write_text(run_markdown(results), encoding="utf-8")
    (folder / "junit.xml").write_bytes(junit_xml(results))


@contextmanager
def run_folder(folder: str | Path) -> Iterator[Path]:
    """An empty folder beside the one asked for, which it replaces when the block ends well; else nothing is left of it.

    Raises:
        DropspinError: On entering, if the folder holds something else or cannot be written.
    """
    target = Path(os.path.realpath(folder))
    made = []
    try:
        _assert_replaceable(folder, target)
        made = [parent for parent in target.parents if not parent.exists()]
        target.parent.mkdir(parents=True, exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix=f".{target.name[:100]}-unfinished-", dir=target.parent))
        unfinished.chmod(target.stat().st_mode if target.exists() else 0o777 & ~_umask())
    except OSError as error:
        raise DropspinError(f"{folder}: cannot be written: {error.strerror}; choose another folder.") from None
    try:
        yield unfinished
        _assert_replaceable(folder, target)
        _swap(unfinished, target)
    except OSError as error:
        raise DropspinError(f"{folder}: cannot be written: {error.strerror}; the folder is as it was.") from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
        for parent in made:
            with suppress(OSError):  # it holds the run, or somebody else's
                parent.rmdir()


PARTS = "[0-9]*"


class MeasuredScenes:
    """The scenes of a run that are measured already, on disk beside the folder that the run will have.

    A run that is interrupted, or killed, leaves them there; one that ends well does not.
    """

    def __init__(self, folder: str | Path) -> None:
        target = Path(os.path.realpath(folder))
        self._path = target.with_name(f".{target.name[:100]}-measured")

    def keep(self, part: Results) -> None:
        """Write a scene's results, whole or not at all."""
        [scene] = part.scenes
        self._path.mkdir(exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix="unfinished-", dir=self._path))
        save(part, unfinished)
        unfinished.rename(self._path / f"{len(self):03d}-{part.scenes[scene].digest}")

    def __len__(self) -> int:
        return len(list(self._path.glob(PARTS)))

    def parts(self) -> list[Results]:
        """What there is, in no order."""
        return [load_results(path) for path in sorted(self._path.glob(PARTS))]

    def clear(self) -> None:
        """Forget it."""
        shutil.rmtree(self._path, ignore_errors=True)


def _umask() -> int:
    """The process's own; it can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _swap(unfinished: Path, target: Path) -> None:
    """Put the new folder in the place of the old one, if there is one; if that fails the old one goes back."""
    if not target.exists():
        unfinished.rename(target)
        return
    old = unfinished.with_name(unfinished.name.replace("-unfinished-", "-old-"))
    target.rename(old)
    try:
        unfinished.rename(target)
    except BaseException:
        old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _assert_replaceable(given: str | Path, target: Path) -> None:
    """Raise `DropspinError` if writing a run there would destroy something else."""
    if not target.exists():
        return
    if not target.is_dir():
        raise DropspinError(f"{given}: is a file; choose a folder.")
    if target == Path.cwd() or target in Path.cwd().parents or os.path.ismount(target):
        raise DropspinError(
            f"{given}: the working directory, or a mount point, cannot be replaced; choose a folder inside it, or work from outside."
        )
    known = _files_of_run(target)
    strangers = sorted(str(path.relative_to(target)) for path in target.rglob("*") if str(path.relative_to(target)) not in known)
    if strangers:
        raise DropspinError(
            f"{given}: holds files that are no run of dropspin, {strangers[0]!r} for one; move them away, or choose an empty or new folder."
        )


def _files_of_run(folder: Path) -> set[str]:
    """Everything that a run wrote into its folder, as far as it can be told; nothing if no run is there."""
    try:
        content = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        arrays, scenes = {*content["trajectories"], *content["ensembles"]}, content["scenes"]
    except (OSError, ValueError, TypeError, KeyError):
        return set()
    plots = {f"plots/{number:02d}-{kind}.{ending}" for number in range(len(scenes)) for kind in FIGURES for ending in ("svg", "png")}
    return {*OURS, *arrays, *plots}
