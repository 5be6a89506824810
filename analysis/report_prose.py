"""Sections of a report from templates that read like the report (Jinja, in `analysis/prose/`).

A template is the text of a section. Blank lines part its paragraphs; `# ` begins the title, `> ` a note, `~ `
a paragraph on methods, which comes last in the section. Line breaks within a paragraph do not count. Fixed
prose stands there as prose, with the numbers put in. A template may be given a function that looks its
numbers up, e.g. `{{ number("paired", "gym", "mean") | fixed(2) }}`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from evenlight.analysis.report import Picture, Section, Table
from evenlight.analysis.wording import counted, in_words, listed, p_in_words, spaced

if TYPE_CHECKING:
    from jinja2 import Environment


def prose(template: str, **values: Any) -> tuple[str, ...]:
    """Return the paragraphs of a template.

    Parameters
    ----------
    template : str
        Its name in `analysis/prose/`, without `.txt`.
    **values
        What it names; a name that is missing is an error.
    """
    text = _environment().get_template(f"{template}.txt").render(**values)
    return tuple(" ".join(block.split()) for block in text.split("\n\n") if block.strip())


def section(
    template: str,
    tables: Sequence[Table] = (),
    pictures: Sequence[Picture] = (),
    *,
    simulated: bool = False,
    **values: Any,
) -> Section:
    """Return a section of a report whose title, paragraphs and notes are a template's.

    Parameters
    ----------
    template : str
        Its name in `analysis/prose/`, without `.txt`.
    tables : sequence of Table
        The tables after its text.
    pictures : sequence of Picture
        Its figures.
    simulated : bool
        Whether it rests on simulated data; the heading says so, and the template may name it.
    **values
        What the template names.
    """
    blocks = prose(template, simulated=simulated, **values)
    signs = ("# ", "> ", "~ ")
    titles, notes, methods = (tuple(b[2:] for b in blocks if b.startswith(sign)) for sign in signs)
    text = tuple(b for b in blocks if not b.startswith(signs))
    return Section(titles[0], text, tuple(tables), tuple(pictures), notes, simulated, methods=methods)


@cache
def _environment() -> Environment:
    import jinja2  # not needed by commands that write no report

    found = jinja2.Environment(
        loader=jinja2.PackageLoader("evenlight.analysis", "prose"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,  # plain text; the report escapes it
    )
    found.filters.update(
        counted=counted,
        listed=listed,
        p=p_in_words,
        spaced=spaced,
        in_words=in_words,
        fixed=lambda value, digits=2: f"{value:z.{digits}f}",
        percent=lambda value, digits=0: f"{100 * value:.{digits}f} %",
    )
    return found
