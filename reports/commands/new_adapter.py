"""`dropspin new-adapter`."""

import keyword
import re
from importlib.util import find_spec
from pathlib import Path

import click

from dropspin.reports.terminal.safe_output import echo

TEMPLATE = Path(__file__).parents[1] / "adapter_template"
NAME = r"[A-Za-z][A-Za-z0-9_]{0,59}"
"""Names of modules; with - in place of _ they are names of engines."""


@click.command("new-adapter")
@click.argument("name")
@click.option("-o", "--output", default=".", metavar="FOLDER", help="Folder for the two files.")
def new_adapter_command(name: str, output: str) -> None:
    """Write a working adapter, NAME.py, and tests of it, test_NAME.py, to change into the adapter of your engine.

    NAME is the name of a Python module, such as my_engine. The class in it is then MyEngine, and results have the name my-engine.
    """
    from dropspin.comparisons.results.complete_folders import study_folder
    from dropspin.scenarios import DropspinError

    adapter = _class_name(name)
    names = {"my_engine": name, "MyEngine": adapter, "my-engine": name.replace("_", "-")}
    targets = {"my_engine.py": f"{name}.py", "test_my_engine.py": f"test_{name}.py"}
    with study_folder(output) as unfinished:
        for path in (Path(output, target) for target in (name, *targets.values())):  # a package would hide the module
            if path.exists():
                raise DropspinError(f"{path}: exists already; choose another name, or another folder with -o.")
        for source, target in targets.items():
            text = (TEMPLATE / source).read_text(encoding="utf-8")
            for old, new in names.items():
                text = text.replace(old, new)
            (unfinished / target).write_text(text, encoding="utf-8")
    where = "" if output == "." else f" in {output}"
    echo(f"Written{where}: {name}.py, a working adapter with a toy engine, and test_{name}.py.")
    echo(f"Check them{where}: dropspin conform {name}:{adapter}; pytest test_{name}.py")
    echo("Then replace the toy engine by yours, and check again; see the page 'Bring your engine' of the documentation")


def _class_name(name: str) -> str:
    """The name of the class in a new module.

    Raises:
        DropspinError: A module or an engine cannot have the name, or has it already.
    """
    from dropspin.comparisons.engines.registry import engine_names
    from dropspin.scenarios import DropspinError
    from dropspin.scenarios.validation import shown

    if not re.fullmatch(NAME, name) or keyword.iskeyword(name):
        raise DropspinError(
            f"NAME: got {shown(name)}; give a name for a Python module, such as my_engine: ASCII letters, digits and _, a letter first, "
            "at most 60 characters, no keyword."
        )
    taken = "an engine" if name.replace("_", "-") in engine_names() else "an importable module" if find_spec(name) else ""
    if taken:
        raise DropspinError(f"NAME: got {shown(name)}, which is already the name of {taken}; choose another one, such as {name}_adapter.")
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))
