"""What the scenes are made from, as one number: it changes with anything that may change a picture."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from stimuli import fractal_noise


@cache
def scenes_sha256() -> str:
    """Return the SHA-256 of the scenes' source: geometry, textures, light, drawing."""
    digest = hashlib.sha256()
    for file in [*sorted(Path(__file__).parent.glob("*.py")), Path(fractal_noise.__file__)]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()
