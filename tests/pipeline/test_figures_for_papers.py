"""Figures as a paper takes them: SVG and PDF beside each PNG, in the fonts and colours of a style sheet."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from matplotlib.colors import to_rgba
from optimized_videos import texture, video
from typer.main import get_command

import evenlight
from evenlight.analysis import figure_style as style
from evenlight.analysis.figure_style import INK, OURS, look, new_figure, png_bytes
from evenlight.command import app
from evenlight.data_schema.errors import InputError

STYLE = """
font.family: serif
font.serif: DejaVu Serif
font.size: 8  # as the journal wants it
text.color: 112233
axes.edgecolor: 445566
grid.color: ddeeff
axes.prop_cycle: cycler('color', ['aa1100', '0011aa', '11aa00', 'aa11aa', '888800'])
figure.figsize: 2, 2
"""
OUR_COLOURS = {value.lower() for value in vars(style).values() if re.fullmatch("#[0-9A-F]{6}", str(value))}
FAMILIES = {
    "fit": "fit pilot",
    "analyze": "analyze pilot",
    "plan": "plan comparison --participants 4,6",
    "optimize": "optimize clip.mkv --budget 0.5 --no-player",
    "control": "control clip.mkv --target-loss 0.02 --no-player",
    "judge": "judge clip.mkv track --measures relative --no-modulation",
    "catalogue": "catalogue clip.mkv --budget 0.5 --no-player --cluster local:1",
    "run": "run power-sweep --rig simulated --simulate data --session 01",
}
BEFORE = {  # what each begins with; a catalogue that is there gets what is asked for later
    "fit": "simulate ramp --participants 4 --design quick --out pilot",
    "analyze": "simulate ramp --participants 4 --design quick --out pilot",
    "judge": "optimize clip.mkv --budget 0.5 --no-player --out track",
    "catalogue": f"{FAMILIES['catalogue']} --out out",
}


@pytest.mark.parametrize("family", FAMILIES)
def test_every_command_writes_each_figure_as_svg_and_pdf_in_a_style_sheets_look(
    command: Any, tmp_path: Path, family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    video(Path("clip.mkv"), [texture(1) * k / 6 for k in range(1, 7)])
    Path("paper.mplstyle").write_text(STYLE)
    command(*BEFORE.get(family, "displays").split())
    asked = ("--figures", "svg", "--figures", "pdf", "--figure-style", "paper.mplstyle")
    done = command(*FAMILIES[family].split(), "--out", "out", *asked)
    assert done.code == 0, done.err
    drawn = list(Path("out").rglob("*.png"))
    assert drawn
    for png in drawn:
        svg = png.with_suffix(".svg").read_text()
        texts = ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")
        assert sum(len(one.text or "") for one in texts) > 30, png
        assert set(re.findall("font-family: '([^']*)'", svg)) == {"DejaVu Serif"}
        assert not OUR_COLOURS & set(re.findall("#[0-9a-f]{6}", svg)), png
        pdf = png.with_suffix(".pdf").read_bytes()
        assert pdf.startswith(b"%PDF"), png
        assert b"/FontFile2" in pdf, png  # TrueType, of which journals take no outlines
        assert b"/Type3" not in pdf, png
    assert not any("<svg" in page.read_text() for page in Path("out").rglob("report.html"))
    assert command("validate", "out").code == 0


def test_commands_that_draw_take_figures_and_no_module_writes_one_by_itself() -> None:
    every = get_command(app).commands  # type: ignore[attr-defined] # of a group
    every |= {f"measure {name}": one for name, one in every["measure"].commands.items()}
    taking = {name for name, one in every.items() if "figures" in {option.name for option in one.params}}
    assert taking == {*FAMILIES, "demo", "reproduce", "measure played", "measure saving"}
    for path in (Path(evenlight.__file__).parent / "analysis").rglob("*.py"):
        by_itself = re.search(r"write_whole\(.*png|\.savefig\(", path.read_text())
        assert not by_itself or path.name == "figure_style.py", path


def drawn() -> Any:
    with look():
        figure = new_figure(height=2.0)
        figure.text(0.1, 0.5, "50 % of $x$", color=INK)
        figure.add_axes((0.1, 0.1, 0.8, 0.8)).plot([1, 2], [2, 1], "o-", color=OURS)
        return figure


def test_a_style_sheet_counts_for_what_is_drawn_in_its_block_wherever_it_is_written(tmp_path: Path) -> None:
    """A notebook shows a figure when the block has ended."""
    (tmp_path / "paper.mplstyle").write_text(STYLE + "text.usetex: True\n")
    usual = drawn()
    with evenlight.figures_as(style=tmp_path / "paper.mplstyle"):
        own = drawn()
    assert own.axes[0].lines[0].get_markerfacecolor() == to_rgba("#aa1100")
    assert "#aa1100" in png_bytes(own, "svg").decode()
    assert tuple(own.get_size_inches()) == (8.0, 2.0)  # the layout is ours
    for kind in ("png", "svg", "pdf"):
        assert png_bytes(drawn(), kind) == png_bytes(usual, kind)  # of other days, too
    assert b"50 % of $x$" in png_bytes(usual, "svg")


def test_another_format_or_a_wrong_setting_is_refused(tmp_path: Path) -> None:
    for kinds, sheet, told in (
        (("eps",), "", "figures must be one of svg, pdf, got 'eps'"),
        ((), "font.sise: 9", "unknown key 'font.sise'; did you mean 'font.size'"),
        (
            (),
            "ink.of.us: 9",
            "own.mplstyle: unknown key 'ink.of.us'; nor is any like it known",
        ),  # of hundreds
        ((), "font.size: wide", "Could not convert 'wide' to float"),
    ):
        (tmp_path / "own.mplstyle").write_text(sheet)
        with pytest.raises(InputError, match=re.escape(told)):
            evenlight.figures_as(*kinds, style=tmp_path / "own.mplstyle")
