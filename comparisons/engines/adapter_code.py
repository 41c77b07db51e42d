"""The hash of an adapter's code: a changed adapter is another engine, whatever its version says."""

import ast
import hashlib
import inspect
import os
import re
import sys
import sysconfig
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import cache
from glob import glob
from importlib.util import find_spec, resolve_name
from itertools import accumulate, chain
from pathlib import Path

from dropspin.comparisons.engines.base import Engine, EngineBroken
from dropspin.comparisons.engines.program_engine import ProgramEngine
from dropspin.scenarios.validation import shown

PACKAGE, COMMON = "dropspin.comparisons.engines", frozenset({"base", "options", "packages", "settings"})
INSTALLED = frozenset({"site-packages", "dist-packages", "node_modules"})
LIBRARIES = re.compile(r".+\.(so(\.\d+)*|dylib|dll|pyd)", re.IGNORECASE)
SCRIPTS = re.compile(rf"{LIBRARIES.pattern}|.+\.(py|js|mjs|cjs|ts|wasm|jar|class|jl|lua|m|pl|r|rb|sh)", re.IGNORECASE)
"""What a program may load beside libraries; data are left out, because a run may write them."""
MOST_ENTRIES, MOST_BYTES = 100_000, 2**28
"""Of files and folders below an adapter that are searched, and of the files that are hashed: they take about a second."""
STANDARD = tuple(Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib"))


def adapter_code(adapter: type[Engine], loaded: Iterable[str] = (), *, with_below: bool = True) -> str | None:
    """A short hash of an adapter's file and of every module that it loads, outside the standard library and installed packages.

    The files in the command of a `ProgramEngine` belong to it, and the adapter's `code_files`: by default the shared libraries in and below
    the folder of its file, and those scripts if it is a `ProgramEngine`.

    The modules are those that the files import, in functions too; modules that are imported by a computed name are found only in `loaded`.

    Args:
        adapter: The engine's class.
        loaded: Names of further modules that were loaded with it.
        with_below: Whether files in folders below that of the adapter count, and scripts of a program beside it, which an engine may
            build when it is first used.

    Returns:
        The hash; None for a class that is not in a file.

    Raises:
        EngineBroken: A file of `code_files` does not exist.
    """
    try:
        file = Path(inspect.getfile(adapter)).resolve()
    except (OSError, TypeError):
        return None
    if adapter.__module__.startswith(f"{PACKAGE}."):
        return built_in_code(file)
    files = _with_imports({file: adapter.__module__}, _file)
    further = {other: name for name in loaded if (other := _file(name)) is not None and other not in files}
    command = filter(os.path.isfile, adapter.command()) if issubclass(adapter, ProgramEngine) else ()
    return hash_of({*files, *_with_imports(further, _file), *_code_files(adapter, file.parent, with_below), *map(Path, command)})


def _code_files(adapter: type[Engine], folder: Path, with_below: bool) -> Iterable[Path]:
    """The files of `code_files`, by default libraries and scripts in and below a folder."""
    patterns = adapter.code_files
    if patterns is None:
        wanted = SCRIPTS if with_below and issubclass(adapter, ProgramEngine) else LIBRARIES
        return [] if INSTALLED.intersection(folder.parts) else _found(folder, wanted, with_below)
    if isinstance(patterns, str) or not all(isinstance(pattern, str) for pattern in patterns):
        raise EngineBroken(f'{adapter.__name__}.code_files is {shown(patterns)}; give a sequence of strings, such as ("../build/*.so",).')
    found: list[Path] = []
    for pattern in patterns:
        files = [folder / path for path in glob(pattern, root_dir=folder, recursive=True) if (folder / path).is_file()]
        if not files:
            raise EngineBroken(f"{adapter.__name__}.code_files: no file {shown(pattern)} in {folder}; paths are relative to this folder.")
        found += files
    return map(_real, found)


def _found(folder: Path, wanted: re.Pattern[str], with_below: bool) -> list[Path]:
    """The files with such names in and below a folder, not in hidden or installed ones; those in it alone if very many are below it."""
    found: list[list[Path]] = []
    entries = size = 0
    for here, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".") and name not in INSTALLED]
        files = [_real(Path(here, name)) for name in names if wanted.fullmatch(name)]
        found.append([file for file in files if file.is_file() and os.access(file, os.R_OK)])
        entries, size = entries + len(folders) + len(names), size + sum(file.stat().st_size for file in found[-1])
        if not with_below or entries > MOST_ENTRIES or size > MOST_BYTES:  # as below a home folder
            return found[0]
    return list(chain(*found))


def _real(path: Path) -> Path:
    """A path without symbolic links, unless these are a loop."""
    return Path(os.path.realpath(path))


def built_in_code(file: Path) -> str:
    """The short hash of a built-in adapter: its file and those of its folder that the file imports, and others of the same names.

    The modules in `COMMON`, which decide no motion, are left out. No file is imported.
    """

    def beside(name: str) -> Path | None:
        module = name.removeprefix(f"{PACKAGE}.")
        there = file.with_name(f"{module}.py")
        return there if module not in COMMON and there.is_file() else None

    files = _with_imports({file: f"{PACKAGE}.{file.stem}"}, beside)
    return hash_of(same for one in files for same in file.parent.glob(f"{one.stem}.*"))


def hash_of(files: Iterable[Path]) -> str:
    """A short hash of the content of files, in the order of their names."""
    sha = hashlib.sha256()
    for file in sorted(files, key=lambda path: (path.name, path)):
        sha.update(file.read_bytes())
    return sha.hexdigest()[:12]


def _with_imports(files: Mapping[Path, str], file_of: Callable[[str], Path | None]) -> dict[Path, str]:
    """Files of modules and of all that they import, directly or not, with the names of the modules.

    Args:
        files: The files, with the names of their modules.
        file_of: Function from the name of a module to its file, or to None for one that is left out.
    """
    found, left = dict(files), list(files.items())
    while left:
        file, module = left.pop()
        package = module if file.name == "__init__.py" else module.rpartition(".")[0]
        for name in _imported_by(file.read_bytes(), package) if file.suffix == ".py" else ():
            other = file_of(name)
            if other is not None and other not in found:
                found[other] = name
                left.append((other, name))
    return found


@cache
def _imported_by(source: bytes, package: str) -> tuple[str, ...]:
    """The names of modules that a file imports, in functions too; of `from a import b` both a and a.b, which may be a module.

    Each content is parsed once: every run needs the hashes of its adapters.
    """
    names: dict[str, None] = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:  # `import a.b` loads a as well
                names |= dict.fromkeys(accumulate(alias.name.split("."), "{}.{}".format))
        elif isinstance(node, ast.ImportFrom):
            with suppress(ImportError):  # beyond the top-level package: Python itself refuses it when it gets there
                base = resolve_name("." * node.level + (node.module or ""), package)
                names |= dict.fromkeys([base, *(f"{base}.{alias.name}" for alias in node.names)])
    return tuple(names)


def _file(name: str) -> Path | None:
    """The source file of a module; None if the module is installed, built into Python, a part of dropspin, or not found."""
    top = name.partition(".")[0]
    if top == "dropspin" or (name != top and _file(top) is None):  # asking for a submodule imports its package
        return None
    module = sys.modules.get(name)
    try:
        spec = find_spec(name) if module is None else getattr(module, "__spec__", None)
    except (ImportError, AttributeError, ValueError):
        return None
    place = getattr(module, "__file__", None) or getattr(spec, "origin", None)
    if not isinstance(place, str) or not Path(place).is_file():
        return None
    file = Path(place).resolve()
    installed = INSTALLED.intersection(file.parts) or any(file.is_relative_to(folder) for folder in STANDARD)
    return None if installed else file
