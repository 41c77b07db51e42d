"""Where a setting of an MJCF file was written: in an element, in the defaults that apply to it, or among the options."""

from dropspin.comparisons.diagnosis.source import Element, Setting

NO_DEFAULTS = ("freejoint",)
"""Elements of MJCF that no default class applies to."""


def mjcf_setting(element: Element, attribute: str) -> Setting | None:
    """Where an attribute of an element of MJCF was set: there, or in a default class that applies to it; None if nowhere.

    MuJoCo merges several sections of defaults into one.
    """
    if attribute in element.attributes or element.tag in NO_DEFAULTS:
        return element.setting(attribute)
    name, place = element.attributes.get("class"), element.parent
    while name is None and place is not None:
        name, place = place.attributes.get("childclass"), place.parent
    root = element
    while root.parent is not None:
        root = root.parent
    classes = list(root.every("default"))
    sections = [one for one in classes if one.parent is root]
    chosen = [one for one in classes if one.attributes.get("class") == name] if name else []
    default: Element | None = next(reversed(chosen or sections), None)
    while default is not None and default.tag == "default":
        for child in reversed(default.children):
            if child.tag == element.tag and attribute in child.attributes:
                return child.setting(attribute)
        earlier = sections[: next((number for number, section in enumerate(sections) if section is default), 0)]
        default = earlier[-1] if earlier else default.parent
    return None


def option_setting(root: Element, tag: str, attribute: str, default: str) -> Setting:
    """A global setting of a model, such as the time step: the last one written, or the engine's default."""
    written = [setting for element in root.every(tag) if (setting := element.setting(attribute)) is not None]
    return written[-1] if written else Setting(f'{attribute}="{default}"')
