"""HTML pages from Jinja templates; values are escaped."""

import base64
import hashlib
import re
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from dropspin.comparisons.judging.verdicts import MARKS
from dropspin.comparisons.measuring.predictions import spins_steadily
from dropspin.reports.plots.chart_data import chart_data
from dropspin.reports.plots.colours import NAMES, human_label, in_sentence
from dropspin.reports.stories import numbers
from dropspin.reports.stories.scene import left_out, modelled
from dropspin.scenarios import reference_for
from dropspin.scenarios.problems import identifier

LABELS = re.compile(rf"(?<![\w'=/.\[-])(?<!-e )(?<!rerun )(?:{'|'.join(sorted(NAMES, reverse=True))})(?![\w-]|[.:]\w)(?:\[[^\]]*\])?")
"""The labels of engines that have names."""


def with_minus(text: str) -> str:
    """A text whose negative numbers have a minus sign instead of a hyphen, except in settings and lists, which may be copied."""
    return re.sub(r"(?:^|(?<=[(±])|(?<=[a-z→:…] )|(?<=, )(?=\S+ to ))-(?=[.0-9])", "−", text)


def with_names(text: str) -> str:
    """A sentence with the names of engines in place of their labels, except in commands."""
    return LABELS.sub(lambda label: in_sentence(label[0]), text)


def _unbroken(text: str) -> str:
    """A sentence that is not broken between a number and its unit."""
    return re.sub(r"(?<=\d) (?=(?:%|[mµn]?s|[kmµ]?m|m?rad)(?!\w))", "\xa0", text)


def _base64_sha256(text: str) -> str:
    """The hash by which a page's policy allows one script, and no other."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


ENVIRONMENT = Environment(
    loader=PackageLoader("dropspin.reports"),
    autoescape=True,
    keep_trailing_newline=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
ENVIRONMENT.filters |= {name: getattr(numbers, name) for name in ("in_ms", "unit", "outcome", "duration")}
ENVIRONMENT.filters |= {"unbroken": _unbroken, "human": human_label, "minus": with_minus, "names": with_names}
ENVIRONMENT.filters["formatted"] = lambda value: with_minus(numbers.formatted(value))
ENVIRONMENT.filters |= {"chart_data": chart_data, "sha256": _base64_sha256}
ENVIRONMENT.globals |= {"marks": MARKS, "identifier": identifier, "reference_for": reference_for}
ENVIRONMENT.globals |= {"modelled": modelled, "left_out": left_out, "spins_steadily": spins_steadily}


def page(template: str, **content: Any) -> str:
    """A page from one of the templates in `reports/templates/`."""
    return ENVIRONMENT.get_template(template).render(content)
