"""The programs in docs/by_hand, which repeat findings with an engine alone."""

import ast
import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PACKAGES = {
    "check_sapien.py": {"sapien"},
    "check_exudyn.py": {"exudyn"},
    "check_ode.py": {"odepy"},
    "check_box3d.py": {"robox3d"},
    "check_jsbsim.py": {"jsbsim"},
    "check_genesis.py": {"genesis"},
    "check_brax.py": {"brax", "jax"},
    "check_newton.py": {"newton", "warp"},
    "check_mjx.py": {"mujoco", "jax"},
    "check_mujoco_warp.py": {"mujoco", "mujoco_warp", "warp"},
}
"""The engine's packages that each program imports."""
JAVASCRIPT = {
    "check_rapier_js.mjs": "@dimforge/rapier3d-compat",
    "check_cannon_es.mjs": "cannon-es",
    "check_jolt.mjs": "jolt-physics",
    "check_havok.mjs": "@babylonjs/havok",
}
"""The package of each program in JavaScript."""


def imported(program):
    """The packages that a program imports."""
    nodes = list(ast.walk(ast.parse((DOCS / "by_hand" / program).read_text(encoding="utf-8"))))
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom)]
    return {name.partition(".")[0] for name in names}


@pytest.mark.parametrize("program", PACKAGES)
def test_program_imports_its_engine_without_dropspin(program):
    assert imported(program) - {"numpy", "scipy", *sys.stdlib_module_names} == PACKAGES[program]


@pytest.mark.parametrize(("program", "package"), JAVASCRIPT.items())
def test_program_in_javascript_imports_its_engine_alone(program, package):
    """Its other imports are modules of Node.js."""
    text = (DOCS / "by_hand" / program).read_text(encoding="utf-8")
    assert re.findall(r"^import .* from \"(?!node:)", text, re.MULTILINE) == []
    assert re.findall(r"^const NAME = \"(.+)\";$", text, re.MULTILINE) == [package]
    assert "found.resolve(NAME)" in text


def test_page_on_engines_links_every_program():
    page = (DOCS / "engines.md").read_text(encoding="utf-8")
    programs = [path.name for path in (DOCS / "by_hand").iterdir() if path.suffix in (".py", ".mjs")]
    assert sorted(programs) == sorted([*PACKAGES, *JAVASCRIPT])
    assert [name for name in programs if f"](by_hand/{name})" not in page] == []


def test_no_program_hides_a_package_that_another_one_imports():
    """Python looks for modules in the folder of a program first."""
    assert not {Path(name).stem for name in PACKAGES} & set.union(*PACKAGES.values())
