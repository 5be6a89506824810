"""What the scenes are made from, as one number: it changes when the code that makes their pictures does."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from evenlight.stimuli import fractal_noise, sequence_format

FOLDER = Path(__file__).parent
NOT_IN_PICTURES = ("preview.py",)
LIGHT = ("bake*.py", "ray_tree.py", "charts.py", "light*.py", "sky.py")  # what light is worked out by


@cache
def scenes_sha256() -> str:
    """Return the SHA-256 of the scenes' source: geometry, textures, light, drawing, encoding.

    What other packages do, and the graphics driver, is not in it: provenance has their versions.
    """
    digest = hashlib.sha256()
    own = [file for file in sorted(FOLDER.glob("*.py")) if file.name not in NOT_IN_PICTURES]
    for file in [*own, Path(fractal_noise.__file__), Path(sequence_format.__file__)]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def light_sources() -> list[Path]:
    """Return the source files that light is worked out by: what is kept of it holds for these alone."""
    return sorted({file for pattern in LIGHT for file in FOLDER.glob(pattern)})
