"""A task that needs a known amount of memory: for what measures memory in a process of its own."""


def hold(mebibytes: str) -> None:
    """Hold so much memory, all of it touched."""
    held = bytearray(b"1") * (int(mebibytes) << 20)
    assert len(held) == int(mebibytes) << 20
