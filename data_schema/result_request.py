"""What a folder of results was asked for: `request.toml` in it."""

from __future__ import annotations

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import described, record

REQUEST = "request.toml"
COMMANDS = ("optimize", "control", "catalogue", "judge", "fit", "analyze")
Asked = bool | int | float | str | tuple[str, ...]  # what an option or argument can be


@record
class ResultRequest:
    """What a command was asked, and of what: with `--request` it makes the result again."""

    command: str = described(
        "the command of `evenlight` that made the result", pattern=f"^({'|'.join(COMMANDS)})$"
    )
    provenance: Provenance = described(
        "the software, and the SHA-256 of each file or folder that is named", factory=Provenance
    )
    asked: dict[str, Asked] = described(
        "options and arguments by name, defaults too; one that is missing was not given. Names of "
        "files are from the folder where the command ran",
        factory=dict,
    )
