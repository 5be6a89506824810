"""Where a file comes from: versions, revision, seed and the SHA-256 of its inputs."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.quantities import count, described, record
from evenlight.data_schema.storage.input_files import open_input

SCHEMA_VERSION = 2
_PACKAGES = ("numpy", "scipy", "numba", "av")


@record
class Provenance:
    """Where a file comes from."""

    schema_version: int = count(
        "version of the record formats; a file with a newer one is refused", minimum=1, default=SCHEMA_VERSION
    )
    software_version: str = described("Evenlight's version", default="unknown")
    software_revision: str = described(
        "revision of Evenlight's source, where it runs from a checkout", default="unknown"
    )
    seed: int | None = count("seed of the random numbers; null where none were drawn", default=None)
    inputs: dict[str, str] = described("SHA-256 of each input, by its name", factory=dict)
    versions: dict[str, str] = described("versions of the packages that the numbers depend on", factory=dict)


def provenance_now(seed: int | None = None, inputs: dict[str, str] | None = None) -> Provenance:
    """Return the provenance of a file that is written by this software, now.

    Parameters
    ----------
    seed : int, optional
        Seed of the random numbers that went into it.
    inputs : dict of str to str, optional
        SHA-256 of each input by name, from `sha256_of_file` or `sha256_of_bytes`.
    """
    return Provenance(
        schema_version=SCHEMA_VERSION,
        software_version=_installed_version("evenlight"),
        software_revision=_source_revision(),
        seed=seed,
        inputs=dict(inputs or {}),
        versions={name: _installed_version(name) for name in _PACKAGES},
    )


def sha256_of_bytes(content: bytes) -> str:
    """Return the SHA-256 of some bytes as 64 hexadecimal digits.

    >>> sha256_of_bytes(b"")[:12]
    'e3b0c44298fc'
    """
    return hashlib.sha256(content).hexdigest()


def sha256_of_file(path: Path) -> str:
    """Return the SHA-256 of a file, or of a folder's files.

    That of a folder is taken over the relative name and the SHA-256 (32 bytes) of each file below it, in
    order of path.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return _digest(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    if path.is_dir():
        for part in sorted(p for p in path.rglob("*") if p.is_file()):
            digest.update(part.relative_to(path).as_posix().encode())
            digest.update(bytes.fromhex(_digest(part)))
        return digest.hexdigest()
    with open_input(path, "a file") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


@cache
def _installed_version(package: str) -> str:
    """Return the version of an installed package, or "unknown"."""
    from importlib import metadata  # slow to import, and no command needs it to show its help

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


@cache
def _source_revision() -> str:
    """Return the revision of the checkout that this module lies in, marked `-dirty` if it was changed.

    It is "unknown" where this module is installed as a package, even inside the checkout of something else.
    """
    own = Path(__file__).resolve()
    if _git("ls-files", "--error-unmatch", own.name, folder=own.parent) is None:
        return "unknown"
    return _git("describe", "--always", "--dirty", "--abbrev=12", folder=own.parent) or "unknown"


def _git(*arguments: str, folder: Path) -> str | None:
    import subprocess

    try:
        answer = subprocess.run(
            ["git", *arguments], cwd=folder, capture_output=True, text=True, timeout=10, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return answer.stdout.strip() if answer.returncode == 0 else None


def require_seed(seed: int) -> None:
    """Raise `InputError` for a number that is no seed: NumPy's generators take none below 0.

    >>> require_seed(0)
    """
    if seed < 0:
        raise ArgumentError("seed", f"must be 0 or more, got {seed}")
