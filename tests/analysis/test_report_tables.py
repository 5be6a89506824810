"""The tables of a report: words stay whole, long names break where they may; a banner is on every page."""

import pytest

from evenlight.analysis.report import MANY_COLUMNS, Report, Section, Table, breakable, report_html

HASH = "0123456789abcdef" * 4


def page(*tables: Table, banner: str = "") -> str:
    return report_html(Report("t", "l", (Section("s", (), tables),), banner=banner))


def test_no_word_is_broken_to_fit() -> None:
    html = page(Table("t", ("a",), (("published",),)))
    assert "overflow-wrap" not in html
    assert "word-break" not in html
    assert "<wbr>" not in html


@pytest.mark.parametrize(
    ("text", "cell"),
    [("tables/at_a_glance_statistics.csv", "tables/<wbr>at_<wbr>a_<wbr>glance_<wbr>statistics.csv"),
     ("see docs/decisions/simulated-viewers.md", "see docs/<wbr>decisions/<wbr>simulated-viewers.md"),
     ("living_room", "living_room"),  # short
     (HASH, "<wbr>".join(["0123456789abcdef"] * 4)),
     ("a_long_name_of_<b>/", "a_<wbr>long_<wbr>name_<wbr>of_<wbr>&lt;b&gt;/")],
)  # fmt: skip
def test_only_long_names_and_hashes_may_break_and_all_is_escaped(text: str, cell: str) -> None:
    assert breakable(text) == cell
    assert f"<td>{cell}</td>" in page(Table("t", ("a",), ((text,), ("word",))))


@pytest.mark.parametrize("text", ["-5.9 to +2.6", "±0.24", "< 0.001", "+17.9"])
def test_signs_are_not_parted_from_their_numbers(text: str) -> None:
    assert f'<td class="number">{text.replace("<", "&lt;")}</td>' in page(Table("t", ("a",), ((text,),)))


def test_tables_of_many_columns_are_set_smaller() -> None:
    for count, many in ((MANY_COLUMNS - 1, False), (MANY_COLUMNS, True)):
        table = Table("t", tuple("abcdefghijkl"[:count]), (tuple(range(count)),))
        assert ('class="wide many"' in page(table)) == many


def test_a_banner_is_on_the_screen_and_in_the_margin_of_every_printed_page() -> None:
    html = page(Table("t", ("a",), ((1,),)), banner='quick "run" </style>')
    assert '<p class="banner">quick &quot;run&quot; &lt;/style&gt;</p>' in html
    assert '@page { @top-center { content: "quick \\000022run\\000022 \\00003c/style>";' in html
    assert "@top-center" not in page(Table("t", ("a",), ((1,),)))
