"""The text of a model file, MJCF or URDF: its elements with their lines, those of included files too."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from dropspin.scenarios import DropspinError
from dropspin.scenarios.files import read_file

LARGEST_FILE = 50_000_000  # bytes
MOST_ELEMENTS = 100_000


class Setting(NamedTuple):
    """A setting in the words of the model file.

    Attributes:
        text: The attribute and its value, such as `damping="0.01"`.
        file: The file that has it; empty if no file does, and the value is the engine's default.
        line: Its line; 0 if the user has no such file.
    """

    text: str
    file: str = ""
    line: int = 0

    def __str__(self) -> str:
        place = f"{self.file}, line {self.line}" if self.line else self.file
        return f"{self.text} ({place})" if self.file else f"{self.text} (the engine's default)"


Ignored = tuple[str, Setting, str]
"""What an engine read and does not use, or changes: name, what is written, what is in force."""


@dataclass(eq=False)
class Element:
    """An element of XML and where it is written."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    parent: "Element | None" = None
    children: list["Element"] = field(default_factory=list)

    def every(self, *tags: str) -> Iterator["Element"]:
        """The elements within it that have one of the tags, in the order of the file."""
        for child in self.children:
            if child.tag in tags:
                yield child
            yield from child.every(*tags)

    @property
    def around(self) -> Iterator["Element"]:
        """The elements that it is within, from the inside outwards."""
        if self.parent is not None:
            yield self.parent
            yield from self.parent.around

    def setting(self, attribute: str) -> Setting | None:
        """An attribute of it, if it is written there."""
        value = self.attributes.get(attribute)
        return None if value is None else Setting(f'{attribute}="{value}"', self.file, self.line)

    def number(self, attribute: str, default: float) -> float:
        """The value of an attribute that is a number.

        Raises:
            DropspinError: It is not a number.
        """
        try:
            return float(self.attributes.get(attribute, default))
        except ValueError:
            written = f'{attribute}="{self.attributes[attribute]}"'
            raise DropspinError(f"{self.file}: line {self.line}: {written} is not a number.") from None

    @property
    def words(self) -> Setting:
        """The element with all its attributes."""
        return Setting(f"{tagged(self.tag, self.attributes)}>", self.file, self.line)

    def changed(self, attributes: Mapping[str, object]) -> Setting:
        """The element with other attributes, to paste in its place."""
        text = tagged(self.tag, {**self.attributes, **attributes})
        return Setting(f"{text}{'>' if self.children else '/>'}{self.within}", self.file, self.line)

    @property
    def within(self) -> str:
        """The words that it is in a `replicate` of MJCF, whose copies all change with it; empty if it is in none."""
        return " within <replicate>" if any(one.tag == "replicate" for one in self.around) else ""


def tagged(tag: str, attributes: Mapping[str, object]) -> str:
    """An element of XML without its end."""
    return f"<{tag}{''.join(f' {name}={quoteattr(str(value))}' for name, value in attributes.items())}"


def read_source(path: Path) -> Element:
    """The root element of a model file, with included files in place of their elements.

    Raises:
        DropspinError: A file is missing, not XML, too large, declares entities, or includes itself.
    """
    return _read(path, path.parent, (), [0])


def _read(path: Path, home: Path, within: tuple[Path, ...], count: list[int]) -> Element:
    if path.resolve() in within:
        raise DropspinError(f"{path}: includes itself, by way of {within[-1].name}; remove the include.")
    raw = read_file(path, str(path), "model", LARGEST_FILE)
    try:
        raw.decode()
    except UnicodeDecodeError:
        raise DropspinError(f"{path}: is not encoded as UTF-8; save it as UTF-8.") from None
    parser, stack = expat.ParserCreate(), [Element("", {}, path.name, 0)]

    def start(tag: str, attributes: dict[str, str]) -> None:
        count[0] += 1
        if count[0] > MOST_ELEMENTS:
            raise DropspinError(f"{path}: has more than {MOST_ELEMENTS:,} elements; give a smaller model.")
        if tag.startswith("xacro:"):
            raise DropspinError(f"{path}: line {parser.CurrentLineNumber}: has macros; expand them first, with: xacro {path.name}")
        parent, found = stack[-1], [Element(tag, attributes, path.name, parser.CurrentLineNumber, stack[-1])]
        stack.extend(found)
        if tag == "include" and parent.tag:
            places = [place / attributes.get("file", "") for place in (home, path.parent)]
            there = next((place for place in places if place.is_file()), places[0])
            found = _read(there, home, (*within, path.resolve()), count).children
        parent.children += found
        for child in found:
            child.parent = parent

    def refuse(*declaration: object) -> None:
        raise DropspinError(f"{path}: line {parser.CurrentLineNumber} declares a document type or entities, which models do not need.")

    parser.StartElementHandler, parser.EndElementHandler = start, lambda tag: stack.pop()
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(raw, True)
    except (expat.ExpatError, ValueError) as error:
        raise DropspinError(f"{path}: not XML: {error}.") from None
    [root] = stack[0].children
    root.parent = None
    return root
