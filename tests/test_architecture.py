"""What is imported when, and what `import dropspin` offers."""

import importlib
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

import dropspin

ROOT = Path(__file__).parents[1]
PACKAGES = ("scenarios", "reference_impl", "comparisons", "reports")
SLOW = {"numba", "pandas", "pyarrow", "matplotlib", "mujoco", "pybullet", "scipy.stats", "scipy.spatial", "scipy.optimize"}
EVERYTHING = {"click", "numpy", "pandas", "pydantic", "rich", "scipy", *(f"dropspin.{name}" for name in PACKAGES)}
COMMAND = "import sys, os\nsys.argv = ['dropspin', *{!r}]\nimport dropspin\ntry:\n    dropspin.main()\nexcept SystemExit:\n    pass\n"


def modules_after(program):
    """The names of all modules that a fresh interpreter has imported after a program."""
    done = subprocess.run([sys.executable, "-c", f"{program}\nimport sys\nprint(*sys.modules)"], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("program", "absent"),
    [
        ("import dropspin", EVERYTHING),
        ("import dropspin; dir(dropspin)", EVERYTHING),
        ("import dropspin; dropspin.load", SLOW | {"scipy", "dropspin.comparisons", "dropspin.reports", "rich"}),
        ("from dropspin import scenarios", SLOW | {"scipy", "mpmath"}),
        ("from dropspin import reference_impl", {"mujoco", "pybullet", "pandas", "pydantic", "dropspin.scenarios"}),
        ("from dropspin import comparisons", SLOW | {"jinja2", "rich", "dropspin.reports"}),
        ("from dropspin import reports", SLOW | {"jinja2", "rich"}),
        ("import dropspin.pytest_plugin", EVERYTHING | {"tomlkit", "filelock"}),
        (COMMAND.format(["--help"]), EVERYTHING - {"click", "dropspin.reports", "dropspin.comparisons"}),
        (COMMAND.format(["list"]), SLOW | {"scipy", "jinja2"}),
        (COMMAND.format(["list", "metrics"]), SLOW | {"scipy", "jinja2"}),
        (COMMAND.format(["show", "drop-ball"]), SLOW | {"scipy", "jinja2"}),
    ],
    ids=lambda case: case.splitlines()[1] if isinstance(case, str) and "\n" in case else case if isinstance(case, str) else "",
)
def test_slow_and_optional_modules_are_not_imported_before_they_are_needed(program, absent):
    """In a fresh interpreter, so that help, lists and scenes are printed at once."""
    assert not modules_after(program) & absent


def test_every_public_name_resolves():
    """And `dir(dropspin)` lists them, for completion."""
    assert set(dir(dropspin)) == set(dropspin.__all__)
    for name in dropspin.__all__:
        assert getattr(dropspin, name) is not None


def test_an_unknown_public_name_raises_attribute_error():
    with pytest.raises(AttributeError, match="module 'dropspin' has no attribute 'rnu'"):
        dropspin.rnu  # noqa: B018


def test_public_names_are_imported_from_the_modules_that_define_them():
    for name, (module, _) in dropspin._LOCATIONS.items():
        found = getattr(dropspin, name)
        assert getattr(found, "__module__", module) in (module, "builtins"), f"{name} is defined in another module"


def test_no_file_is_loaded_under_two_names():
    """The four packages stand at the root of a checkout, which is on the path, and are linked into `dropspin`."""
    assert all(getattr(dropspin, name) is not None for name in dropspin.__all__)
    loaded = [Path(file).resolve() for module in list(sys.modules.values()) if (file := getattr(module, "__file__", None))]
    files = Counter(file for file in loaded if any(file.is_relative_to(ROOT / package) for package in PACKAGES))
    assert len(files) > 100
    assert set(files.values()) == {1}


@pytest.mark.parametrize("package", PACKAGES)
def test_import_by_an_earlier_name_says_the_new_one(package):
    with pytest.raises(ImportError, match=f"import dropspin.{package}, not {package}"):
        importlib.import_module(package)
