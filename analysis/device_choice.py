"""Which device computes loss curves, said before the work begins."""

from __future__ import annotations

import typer

from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.method.analysis_device import make_frame_analysis
from evenlight.method.choices import Device
from evenlight.method.loss_curves import SMALLEST_SIDE, brightness_factors


def chosen_device(device: Device, display: Display, model: ContrastModel, quiet: bool) -> Device:
    """Return the device that computes loss curves, and say why it is not the graphics processor.

    Parameters
    ----------
    device : Device
        What is asked for.
    display, model : Display, ContrastModel
        What the curves are for: the graphics processor cannot do all choices of the model.
    quiet : bool
        Whether to say nothing.

    Raises
    ------
    InputError
        If the graphics processor is asked for, and there is none that can.
    """
    if device is Device.CPU:
        return device
    smallest = (SMALLEST_SIDE, SMALLEST_SIDE)
    chosen = make_frame_analysis(smallest, display, model, brightness_factors(), device)
    if not quiet:
        by = "by OpenGL" if chosen.device is Device.GPU else "on the processor"
        typer.echo(f"loss curves {by}: {chosen.reason}", err=True)
    return chosen.device
