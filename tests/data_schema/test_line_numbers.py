"""The line that a message names is the line in which the key stands."""

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.storage.text_files import Place, json_line_numbers, line_of, toml_line_numbers

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=12,
)


def places(content: Any, around: Place = ()) -> set[Place]:
    """Every key and list item in a content, by a plain walk."""
    items: Any = ()
    if isinstance(content, dict):
        items = content.items()
    elif isinstance(content, list):
        items = enumerate(content)
    found = set()
    for key, value in items:
        found |= {(*around, key)} | places(value, (*around, key))
    return found


@given(JSON)
def test_every_key_and_item_of_a_json_text_is_found(content: Any) -> None:
    for indent in (None, 1):
        assert set(json_line_numbers(json.dumps(content, indent=indent))) == places(content)


@given(st.lists(st.text(max_size=4), unique=True, max_size=6))
def test_with_one_key_in_each_line_the_lines_count_up(keys: list[str]) -> None:
    """json.dumps with an indent: `{` in line 1, the k-th key in line k + 1."""
    text = json.dumps(dict.fromkeys(keys, 0), indent=1)
    assert json_line_numbers(text) == {(key,): n for n, key in enumerate(keys, start=2)}


def test_brackets_and_colons_in_texts_are_texts() -> None:
    text = '{"a{[:,": "}],\\"",\n "b": ["x, y", {"c":\n 1}]}'
    assert json_line_numbers(text) == {("a{[:,",): 1, ("b",): 2, ("b", 0): 2, ("b", 1): 2, ("b", 1, "c"): 2}


def test_keys_of_toml_are_found_in_their_tables() -> None:
    text = '# a = 1\nb = 2\n"c d" = 3\n\n[t]\nb = 4\n[t.u]\nb=5\n'
    assert toml_line_numbers(text) == {
        ("b",): 2,
        ("c d",): 3,
        ("t",): 5,
        ("t", "b"): 6,
        ("t", "u"): 7,
        ("t", "u", "b"): 8,
    }


def test_a_missing_key_is_in_the_line_of_what_it_is_missing_in() -> None:
    assert line_of(("display", "gamma"), {("display",): 7}) == 7
    assert line_of(("gamma",), {("display",): 7}) is None
