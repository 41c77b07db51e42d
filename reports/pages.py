"""Pages from Jinja templates, HTML and Markdown; values in HTML are escaped."""

import base64
import hashlib
import re
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from dropspin.comparisons.judging.verdicts import MARKS
from dropspin.reports.views import numbers


def page(template: str, **content: Any) -> str:
    """A page from one of the templates in `reports/templates/`."""
    return _environment().get_template(template).render(content)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("dropspin.reports"),
        autoescape=select_autoescape(enabled_extensions=("html",), disabled_extensions=("md",), default=True),
        keep_trailing_newline=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {name: getattr(numbers, name) for name in ("in_ms", "unit", "word", "formatted", "quantity", "duration")}
    environment.filters |= {"cell": _markdown_cell, "code": _markdown_code, "sha256": _base64_sha256}
    environment.globals |= {"bound": numbers.bound, "subject": numbers.subject, "marks": MARKS}
    return environment


def _base64_sha256(text: str) -> str:
    """The hash by which a page's policy allows one script, and no other."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _markdown_cell(text: str) -> str:
    """Text escaped for a cell of a Markdown table."""
    return re.sub(r"([\\|`*_\[\]<>#])", r"\\\1", " ".join(str(text).split()))


def _markdown_code(text: str) -> str:
    """Text as Markdown code; the fence is longer than any sequence of backticks in the text."""
    fence = "`" * (1 + max((len(found) for found in re.findall("`+", text)), default=0))
    room = " " if len(fence) > 1 else ""
    return f"{fence}{room}{text}{room}{fence}"
