"""Files of an adapter that are changed, as when its engine is compiled again."""

from dropspin.comparisons.engines.adapter_code import adapter_code


def code_with(adapter, file, content):
    """The hash of an adapter with a file of some content, which is the same each time."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)
    file.chmod(0o755)
    found = adapter_code(adapter)
    assert adapter_code(adapter) == found
    return found


def verify_changes_with(adapter, file, changes=True):
    """Verify that an adapter is another engine after a change of a file, or is not."""
    assert (code_with(adapter, file, "1") != code_with(adapter, file, "2")) == changes
