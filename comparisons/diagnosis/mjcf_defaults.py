"""Where a setting of an MJCF file was written: in an element, in the defaults that apply to it, or among the options."""

from dropspin.comparisons.diagnosis.xml_file import Element, Setting


def mjcf_setting(element: Element, attribute: str) -> Setting | None:
    """Where an attribute of an element of MJCF was set: there, or in a default class that applies to it; None if nowhere.

    MuJoCo merges several sections of defaults into one.
    """
    if attribute in element.attributes or element.tag == "freejoint":  # to which no default class applies
        return element.setting(attribute)
    *places, root = element.around
    name = element.attributes.get("class", next((one.attributes["childclass"] for one in places if "childclass" in one.attributes), ""))
    classes = list(root.every("default"))
    sections = [one for one in classes if one.parent is root]
    chosen = [one for one in classes if name and one.attributes.get("class") == name] or sections
    applying = [one for last in chosen[-1:] for one in (last, *last.around) if one.tag == "default"]
    earlier = sections[: sections.index(applying[-1])] if applying else []
    for default in (*applying, *reversed(earlier)):
        for child in reversed(default.children):
            if child.tag == element.tag and attribute in child.attributes:
                return child.setting(attribute)
    return None


def option_setting(root: Element, tag: str, attribute: str, default: str) -> Setting:
    """A global setting of a model, such as the time step: the last one written, or the engine's default."""
    written = [setting for element in root.every(tag) if (setting := element.setting(attribute)) is not None]
    return written[-1] if written else Setting(f'{attribute}="{default}"')
