"""The hash of a built-in adapter: every file whose name begins as the adapter's does, in any language."""

from comparisons.engines.adapter_code import built_in_code


def test_a_changed_file_of_an_adapter_is_another_engine(tmp_path):
    adapter, driver, other = (tmp_path / name for name in ("rapier_js_engine.py", "rapier_js_driver.cjs", "registry.py"))
    for file in (adapter, driver, other):
        file.write_text("a")
    before = built_in_code(adapter)
    other.write_text("b")
    assert built_in_code(adapter) == before
    driver.write_text("b")
    assert built_in_code(adapter) != before
