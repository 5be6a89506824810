"""What the site changes: links to files beside docs/ become their names, notebooks become pages."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path, PurePosixPath
from typing import Any

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)\s]+)\)")
NOTEBOOKS = "examples/notebooks/"


def on_files(files: Any, *, config: Any, **_: Any) -> Any:
    """Add a page for each notebook, with what its cells show when they are run now."""
    from mkdocs.structure.files import File, InclusionLevel

    for path in sorted((Path(__file__).parents[1] / NOTEBOOKS).glob("*.ipynb")):
        where, beside = f"notebooks/{path.stem}.md", InclusionLevel.NOT_IN_NAV
        files.append(File.generated(config, where, content=notebook_page(path), inclusion=beside))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Return a page's text; links that leave docs/ become their words, with the path in the checkout."""
    depth = len(PurePosixPath(page.file.src_uri).parts)

    def named(link: re.Match[str]) -> str:
        words, target = link.groups()
        if target.count("../") < depth:
            return link[0]
        path = target.replace("../", "")
        if path.startswith(NOTEBOOKS):
            return f"[{words}]({'../' * (depth - 1)}notebooks/{PurePosixPath(path).stem}.md)"
        return words if path.strip("/") in words else f"{words} (`{path}`)"

    return LINK.sub(named, markdown)


def notebook_page(path: Path) -> str:
    """Run a notebook in a folder of its own, and return it as a page, with what its cells show."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(notebook, resources={"metadata": {"path": folder}}).execute()
    parts = []
    for cell in notebook.cells:
        code = cell.cell_type == "code"
        parts.append(f"```python\n{cell.source}\n```" if code else cell.source)
        parts += map(_shown, cell.get("outputs", ()))
    parts.append(f"*This is `{NOTEBOOKS}{path.name}`, run when the site was built.*\n")
    return "\n\n".join(filter(None, parts))


def _shown(output: Any) -> str:
    data = output.get("data", {})
    if "text/html" in data:
        page = " ".join(data["text/html"].split("\n"))
        return f"<div>{page}</div>" if page else ""
    if "image/png" in data:
        image = "".join(data["image/png"].split())
        return f'<img alt="{data["text/plain"]}" src="data:image/png;base64,{image}">'
    text = data.get("text/plain", output.get("text", ""))
    return f"```text\n{text}\n```" if text else ""
