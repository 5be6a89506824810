"""A program that prints what ArgyllCMS's `spotread` would; what it measures comes over a socket.

It is run as `spotread_program.py PORT [options of spotread]`, by the script that `EmulatedSpotread` makes.
"""

from __future__ import annotations

import socket
import sys
import time

LAST = b"\n\n"  # the end of all that spotread prints
UNPLUGGED = "Failed to initialise communications with instrument"
BETWEEN_TRIES = 0.02  # [s] the instrument may not have let go of a program that was ended


def main(port: str, options: list[str]) -> None:
    """Ask the emulated instrument what to print, and print it as it comes, until it ends."""
    try:
        while not printed_answer(int(port), " ".join(options)):
            time.sleep(BETWEEN_TRIES)
    except ConnectionRefusedError:
        sys.stdout.write(f"{UNPLUGGED}\n")


def printed_answer(port: int, question: str) -> bool:
    """Print the answer as it comes; return whether there was any."""
    came = b""
    try:
        with socket.create_connection(("127.0.0.1", port)) as link:
            link.sendall(question.encode() + b"\n")
            while not came.endswith(LAST) and (part := link.recv(4096)):
                came += part
                sys.stdout.buffer.write(part)
                sys.stdout.buffer.flush()
    except ConnectionResetError:
        pass  # turned away, or unplugged
    return came != b""


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
