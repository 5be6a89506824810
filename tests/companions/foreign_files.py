"""Tables as files of other programs: spreadsheets, statistics programs, text in several encodings, JSON."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

Table = list[list[Any]]  # the first row has the names
TITLE = "Pilot, May 2026"


def _xlsx(path: Path, table: Table) -> None:
    def cell(value: Any) -> str:
        if isinstance(value, str):
            return f'<c t="inlineStr"><is><t>{escape(value)}</t></is></c>'
        return f"<c><v>{value}</v></c>"

    rows = "".join(f"<row>{''.join(map(cell, row))}</row>" for row in table)
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    of, package = "http://schemas.openxmlformats.org", "package/2006/relationships"
    document = "officeDocument/2006/relationships"
    kinds = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{of}/package/2006/content-types">'
        f'<Override PartName="/xl/workbook.xml" ContentType="{kinds}.sheet.main+xml"/>'
        f'<Override PartName="/xl/worksheets/a.xml" ContentType="{kinds}.worksheet+xml"/></Types>',
        "_rels/.rels": f'<Relationships xmlns="{of}/{package}"><Relationship Id="r1" '
        f'Type="{of}/{document}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{of}/{document}"><sheets>'
        '<sheet name="Notes" sheetId="1" r:id="r2"/><sheet name="Data" sheetId="2" r:id="r1"/>'
        "</sheets></workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{of}/{package}">'
        f'<Relationship Id="r1" Type="{of}/{document}/worksheet" Target="worksheets/a.xml"/>'
        f'<Relationship Id="r2" Type="{of}/{document}/worksheet" Target="worksheets/b.xml"/></Relationships>',
        "xl/worksheets/a.xml": f'<worksheet xmlns="{main}"><sheetData>{rows}</sheetData></worksheet>',
        "xl/worksheets/b.xml": f'<worksheet xmlns="{main}"><sheetData/></worksheet>',
    }
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in parts.items():
            archive.writestr(name, text)


def _ods(path: Path, table: Table) -> None:
    def cell(value: Any) -> str:
        kind = f'float" office:value="{value}' if not isinstance(value, str) else "string"
        text = escape(str(value))
        return f'<table:table-cell office:value-type="{kind}"><text:p>{text}</text:p></table:table-cell>'

    rows = "".join(f"<table:table-row>{''.join(map(cell, row))}</table:table-row>" for row in table)
    names = " ".join(
        f'xmlns:{each}="urn:oasis:names:tc:opendocument:xmlns:{each}:1.0"'
        for each in ("office", "table", "text")
    )
    content = (
        f"<office:document-content {names}><office:body><office:spreadsheet>"
        f'<table:table table:name="Data">{rows}</table:table>'
        "</office:spreadsheet></office:body></office:document-content>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("content.xml", content)
        manifest = "urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"
        archive.writestr("META-INF/manifest.xml", f'<manifest xmlns="{manifest}"/>')


def _statistics(kind: str) -> Callable[[Path, Table], None]:
    def write(path: Path, table: Table) -> None:
        import pandas as pd
        import pyreadstat

        frame = pd.DataFrame(table[1:], columns=table[0])
        write_file = pyreadstat.write_sav if kind == "sav" else pyreadstat.write_dta
        write_file(frame, path, file_label=TITLE)

    return write


def _text(delimiter: str, encoding: str, line_end: str = "\n") -> Callable[[Path, Table], None]:
    def write(path: Path, table: Table) -> None:
        text = "".join(delimiter.join(map(str, row)) + line_end for row in table)
        path.write_bytes(text.encode(encoding))

    return write


def _json(content: Callable[[Table], Any]) -> Callable[[Path, Table], None]:
    return lambda path, table: path.write_text(json.dumps(content(table)), "utf-8")


def _columns(table: Table) -> dict[str, list[Any]]:
    return {name: [row[n] for row in table[1:]] for n, name in enumerate(table[0])}


# What writes a table, by the format and the ending of its file's name.
FORMATS: dict[str, Callable[[Path, Table], None]] = {
    "Excel.xlsx": _xlsx,
    "OpenDocument.ods": _ods,
    "SPSS.sav": _statistics("sav"),
    "Stata.dta": _statistics("dta"),
    "German Excel.csv": _text(";", "cp1252", "\r\n"),
    "Mac.csv": _text(",", "utf-8", "\r"),
    "marked.csv": _text(",", "utf-8-sig"),
    "E-Prime.txt": _text("\t", "utf-16"),
    "E-Prime without mark.txt": _text("\t", "utf-16-le", "\r\n"),
    "UTF-32.csv": _text(",", "utf-32"),
    "table.tsv": _text("\t", "utf-8"),
    "titled.xlsx": lambda path, table: _xlsx(path, [[TITLE], [], *table]),
    "titled.csv": lambda path, table: _text(";", "utf-8")(path, [[TITLE], [], *table]),
    "R.txt": lambda path, table: _text(" ", "utf-8")(
        path, [table[0], *([f'"{n}"', *row] for n, row in enumerate(table[1:], start=1))]
    ),
    "MATLAB.txt": _text("   ", "utf-8", "  \r\n"),
    "objects.json": _json(lambda table: [dict(zip(table[0], row, strict=True)) for row in table[1:]]),
    "arrays.json": _json(lambda table: table),
    "columns.json": _json(_columns),
    "pandas.json": _json(
        lambda table: {k: {str(n): v for n, v in enumerate(c)} for k, c in _columns(table).items()}
    ),
    "split.json": _json(lambda table: {"columns": table[0], "index": [], "data": table[1:]}),
    "held.json": _json(
        lambda table: {"trials": [dict(zip(table[0], row, strict=True)) for row in table[1:]]}
    ),
}
