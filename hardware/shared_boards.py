"""Power boards that are open: one that is both power meter and backlight is opened once, and shared."""

from __future__ import annotations

import os
from collections.abc import Callable
from weakref import WeakValueDictionary

from evenlight.hardware.board_link import PowerBoard
from evenlight.hardware.emulators.link import EmulatedLink
from evenlight.hardware.emulators.power_board import PowerBoardEmulator
from evenlight.hardware.simulated_panel import SimulatedPanel, Simulation

# A port is open once in a process, whoever asks; a board is forgotten with the last device that uses it.
_at_ports: WeakValueDictionary[str, PowerBoard] = WeakValueDictionary()
_on_panels: WeakValueDictionary[int, EmulatedBoard] = WeakValueDictionary()


class EmulatedBoard(PowerBoard):
    """A board on an emulated one, whose link is closed with it.

    Parameters
    ----------
    simulation : Simulation
        What the board measures and dims.
    clock : callable
        For the times at which lines arrive [s].
    """

    def __init__(self, simulation: Simulation, clock: Callable[[], float]) -> None:
        self.panel: SimulatedPanel = simulation.panel  # kept, so that no other has its identity meanwhile
        self._to_emulator = EmulatedLink(PowerBoardEmulator(simulation), pseudo_terminal=True)
        try:
            super().__init__(self._to_emulator.url, clock)
        except BaseException:
            self._to_emulator.unplug()
            raise

    def close(self) -> None:
        """Close the port and the link to the emulated board; more than once does nothing."""
        super().close()
        self._to_emulator.unplug()


def board_at(address: str, clock: Callable[[], float]) -> PowerBoard:
    """Return the board at a port: the one that is open already, or else a new link.

    Parameters
    ----------
    address : str
        Port, and "?baud=" with a baud rate if need be.
    clock : callable
        For the times at which lines arrive [s]; that of the first device where two share the board.
    """
    port = os.path.realpath(address.partition("?")[0])  # links by the board's serial number lead to it, too
    board = _at_ports.get(port)
    if board is None or not board.is_open():
        board = PowerBoard(address, clock)
        _at_ports[port] = board
    return board


def emulated_board(simulation: Simulation, clock: Callable[[], float]) -> PowerBoard:
    """Return the emulated board on a panel: the one that is open already, or else a new one."""
    board = _on_panels.get(id(simulation.panel))
    if board is None or not board.is_open():
        board = EmulatedBoard(simulation, clock)
        _on_panels[id(simulation.panel)] = board
    return board
