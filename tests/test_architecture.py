"""What the packages promise to whoever imports them."""

import importlib
import subprocess
import sys

import pytest


def modules_after(statement):
    program = f"import sys\n{statement}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in done.stdout.split()}


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import scenarios", {"mujoco", "pybullet", "numba", "pandas", "matplotlib", "mpmath"}),
        ("import reference_impl", {"mujoco", "pybullet", "pandas", "pydantic", "scenarios"}),
        ("import comparisons", {"mujoco", "pybullet", "numba", "matplotlib", "jinja2", "rich", "reports"}),
        ("import reports.commands.main", {"mujoco", "pybullet", "numba", "pandas", "scipy", "matplotlib", "rich"}),
        ("import dropspin_command", {"scenarios", "comparisons", "reports", "click"}),
        ("import dropspin_pytest", {"scenarios", "comparisons", "reports", "reference_impl", "click", "numpy", "tomlkit", "filelock"}),
        ("import reports", {"mujoco", "pybullet", "numba", "matplotlib"}),
    ],
)
def test_imports_are_lazy(statement, absent):
    """In a fresh interpreter, what is slow or optional is not loaded before it is needed."""
    assert not modules_after(statement) & absent


@pytest.mark.parametrize("package", ["scenarios", "reference_impl", "comparisons", "reports"])
def test_public_names(package):
    """`__all__` is sorted by kind and complete: every name in it exists and says what it is."""
    module = importlib.import_module(package)
    assert module.__doc__
    for name in module.__all__:
        assert getattr(module, name) is not None
