"""Values, texts and bytes that a file or a command may have although no user means them, and changes to sound ones."""

import copy
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

NUMBERS = st.one_of(
    st.sampled_from([0, 1, -1, 2, 3, 0.0, -0.0, 0.5, -0.5, 1e-320, 1e-12, 1e-3, 1e6, 1e17, 1e155, 1e308, -1e308, 2**53 + 1, 2**63, 2**64]),
    st.sampled_from([10**308, 10**400, float("nan"), float("inf"), -float("inf")]),
    st.floats(),
    st.floats(-10.0, 10.0),
    st.integers(),
)
PLAIN = """. .. ../stray /tmp a/b a.b a[b a] [red]x[/red] [/x] é 日本 <script> | ` $(id) %s {0} { -1 --json nan inf 1e999 0x10 1_0 𝟙
none true null draw-1-001 drop-ball document mujoco infinite solid sphere box __class__"""
WORDS = [*PLAIN.split(), "", " ", "\n", "\r", "\0", "\x7f", "\x1b[31m", "\u202e", "x" * 300, "x" * 5000]
TEXTS = st.sampled_from(WORDS) | st.text(max_size=12)
SPECIAL = ["", "name", "origin", "format", "engine", "dt", "body", "a[b", "a.b", "[", "int", "float", "x" * 300, "\x1b[2J", "__proto__"]
KEYS = st.sampled_from(SPECIAL) | TEXTS
LEAVES = NUMBERS | TEXTS | st.booleans()
VALUES = st.recursive(LEAVES, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=3), max_leaves=6)
JSON = VALUES | st.none() | st.sampled_from(["\ud800", ["\udcff"], [None], {"a": None}, [[]], {}])


def mostly(sound: st.SearchStrategy[Any], other: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Values of one strategy, and one in twenty of another."""
    return st.sampled_from([sound] * 19 + [other]).flatmap(lambda chosen: chosen)


def places(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The paths of all values in nested tables and lists."""
    inner = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in inner:
        yield (*path, key)
        yield from places(value, (*path, key))


@st.composite
def edited(draw: st.DrawFn, tree: Any, values: st.SearchStrategy[Any] = VALUES) -> Any:
    """A copy of nested tables and lists with one to three values replaced, removed or added, or keys renamed."""
    tree = copy.deepcopy(tree)
    for _ in range(draw(st.integers(1, 3))):
        paths = list(places(tree))
        if not paths:
            break
        *path, key = draw(st.sampled_from(paths))
        parent = tree
        for part in path:
            parent = parent[part]
        change = draw(st.sampled_from(["replace", "replace", "replace", "remove", "add", "rename", "scale"]))
        if change == "scale" and type(parent[key]) is float:
            parent[key] = parent[key] * draw(st.sampled_from([-1, 0, 1e-9, 1e-3, 1e3, 1e9, 1e200]))
        elif change == "remove":
            del parent[key]
        elif change in ("add", "rename") and isinstance(parent, dict):
            parent[draw(KEYS)] = parent.pop(key) if change == "rename" else draw(values)
        elif change in ("add", "rename"):
            parent.insert(key, draw(values))
        else:
            parent[key] = draw(values)
    return tree


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """Bytes with one to three places changed, cut out, repeated or added, or cut short."""
    for _ in range(draw(st.integers(1, 3))):
        first = draw(st.integers(0, len(content)))
        last = min(len(content), first + draw(st.sampled_from([1, 2, 8, 64, 4096])))
        part = content[first:last]
        change = draw(st.sampled_from(["flip", "cut", "drop", "insert", "repeat", "zero"]))
        new = {
            "flip": bytes(byte ^ 1 << draw(st.integers(0, 7)) for byte in part[:1]) + part[1:],
            "cut": b"",
            "drop": b"",
            "insert": draw(st.binary(max_size=8)) + part,
            "repeat": part * 3,
            "zero": bytes(len(part)),
        }[change]
        content = content[:first] + new + (b"" if change == "cut" else content[last:])
    return content
