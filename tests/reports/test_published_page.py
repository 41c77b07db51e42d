"""The page on published results: it has the output of the command, with MuJoCo and PyBullet."""

import re

import pytest
from support.published_page import END, PAGE, START, output_of

from dropspin.comparisons.published.sources import sources

SLOW = ("gazebo-boxes", "simbenchmark-bouncing")
"""Sources that take seconds, and whose tables have values of an engine that need not be installed."""


def without_rounding(text):
    """Text without errors of a few rounding units, which differ between processors."""
    return re.sub(r"\| (0|\d(\.\d)?e-1[56]) \| within", "| rounding | within", text)


def sections(text):
    """The sections of a page by title."""
    return {part.partition("\n")[0]: part.strip() for part in text.split("## ")[1:]}


def page():
    return without_rounding(PAGE.read_text(encoding="utf-8").partition(START)[2].partition(END)[0])


@pytest.mark.extended
def test_sections_of_the_page_are_what_the_command_writes():
    printed = sections(page())
    without_data = [source.name for source in sources()]
    names = [name for name in without_data if name not in SLOW]
    written = sections(without_rounding(output_of(*names)))
    assert len(printed) == len(without_data) + 1
    del written["All sources"]
    assert written == {title: text for title, text in printed.items() if title.partition(":")[0] in names}


@pytest.mark.slow
def test_the_whole_page_is_what_the_command_writes():
    assert without_rounding(output_of()).strip() == page().strip()
