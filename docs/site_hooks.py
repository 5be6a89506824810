"""What the site changes in the pages: links to files beside docs/ become their names."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import Any

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)\s]+)\)")


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Return a page's text; links that leave docs/ become their words, with the path in the checkout."""
    depth = len(PurePosixPath(page.file.src_uri).parts)

    def named(link: re.Match[str]) -> str:
        words, target = link.groups()
        if target.count("../") < depth:
            return link[0]
        path = target.replace("../", "")
        return words if path.strip("/") in words else f"{words} (`{path}`)"

    return LINK.sub(named, markdown)
