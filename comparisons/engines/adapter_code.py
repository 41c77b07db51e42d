"""The hash of an adapter's code: a changed adapter is another engine, whatever its version says."""

import ast
import hashlib
import inspect
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from importlib.util import find_spec, resolve_name
from pathlib import Path

PACKAGE, PROTOCOL = "dropspin.comparisons.engines", "base"
INSTALLED = frozenset({"site-packages", "dist-packages"})
STANDARD = tuple(Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib"))


def adapter_code(adapter: type, loaded: Iterable[str] = ()) -> str | None:
    """A short hash of an adapter's file and of every module that it loads, outside the standard library and installed packages.

    The modules are those that the files import, in functions too; modules that are imported by a computed name are found only in `loaded`.

    Args:
        adapter: The engine's class.
        loaded: Names of further modules that were loaded with it.

    Returns:
        The hash; None for a class that is not in a file.
    """
    try:
        file = Path(inspect.getfile(adapter)).resolve()
    except (OSError, TypeError):
        return None
    if adapter.__module__.startswith(f"{PACKAGE}."):
        return built_in_code(file)
    files: dict[Path, None] = {file: None}
    _add_imports(files, file, adapter.__module__)
    for name in loaded:
        _add(files, name)
    return _hashed(files)


def built_in_code(file: Path) -> str:
    """The short hash of a built-in adapter: its file and those of its folder that the file imports, and others of the same names.

    The engine protocol, which all adapters have in common, is left out. No file is imported.
    """
    files: set[Path] = set()
    left = {file}
    while left:
        files |= left
        imported = {name.removeprefix(f"{PACKAGE}.") for one in left for name in _imported(one, PACKAGE)}
        named = {file.with_name(f"{name}.py") for name in imported - {PROTOCOL}}
        left = {one for one in named - files if one.is_file()}
    return _hashed(same for one in files for same in file.parent.glob(f"{one.stem}.*"))


def _hashed(files: Iterable[Path]) -> str:
    found = hashlib.sha256()
    for one in sorted(files, key=lambda path: path.name):
        found.update(one.read_bytes())
    return found.hexdigest()[:12]


def _add(files: dict[Path, None], name: str) -> None:
    """Add the file of a module, and of all that it imports, unless it is installed or known already."""
    file = _file(name)
    if file is not None and file not in files:
        files[file] = None
        _add_imports(files, file, name)


def _add_imports(files: dict[Path, None], file: Path, module: str) -> None:
    if file.suffix == ".py":
        package = module if file.name == "__init__.py" else module.rpartition(".")[0]
        for name in _imported(file, package):
            _add(files, name)


def _imported(file: Path, package: str) -> tuple[str, ...]:
    """The names of modules that a file imports, in functions too; of `from a import b` both a and a.b, which may be a module."""
    return _imported_by(file.read_bytes(), package)


@cache
def _imported_by(source: bytes, package: str) -> tuple[str, ...]:
    """The same for the content of a file, parsed once: every run needs the hashes of its adapters."""
    return tuple(dict.fromkeys(_imports(ast.parse(source), package)))


def _imports(tree: ast.Module, package: str) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            with suppress(ImportError):  # beyond the top-level package: Python itself refuses it when it gets there
                base = resolve_name("." * node.level + (node.module or ""), package)
                yield from (base, *(f"{base}.{alias.name}" for alias in node.names))
            continue
        else:
            continue
        for name in names:  # `import a.b` loads a as well
            parts = name.split(".")
            yield from (".".join(parts[: count + 1]) for count in range(len(parts)))


def _file(name: str) -> Path | None:
    """The source file of a module; None if the module is installed, built into Python, a part of dropspin, or not found."""
    top = name.partition(".")[0]
    if top == "dropspin":
        return None
    if name != top and _file(top) is None:
        return None  # asking for a submodule imports its package
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
