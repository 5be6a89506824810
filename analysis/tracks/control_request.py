"""What is asked of the online controller, once: options of `control`, keywords of `OnlineController`.

Nothing here is slow to import.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from evenlight.analysis.tracks.dimming_options import Dimmed
from evenlight.data_schema.arguments import choice, number
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import Resolution
from evenlight.option_panels import asked, computation, expert, viewing
from evenlight.stimuli.dimming_options import GAINS, AimOptions, File, Member

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display
    from evenlight.method.online.controller import ControllerSettings
    from evenlight.method.online.governor import GovernorSettings
    from evenlight.method.online.lookahead import LookaheadSettings
    from evenlight.method.optimizer.request import Request

EVERY_PIXEL = (1, 0)  # every strip of rows, no halving
ONE_STRIP_IN = 8  # docs/decisions/online-resolution.md has the errors


@dataclass(frozen=True, kw_only=True)
class Steered(AimOptions):
    """What the controller aims at, where it begins, and how much of what comes it knows."""

    lookahead: Annotated[
        float | None,
        asked(
            metavar="SECONDS",
            help="Plan ahead, with so many seconds of the video to come known (0: none), in place of the "
            "PID controller.",
        ),
    ] = None
    start_factor: Annotated[
        float | None,
        expert(
            metavar="FACTOR",
            help="Brightness factor of the first frame. Otherwise the one at which it has the target loss.",
        ),
    ] = None

    def settings(self, min_factor: float) -> ControllerSettings:
        """Return target, gains and bounds of the controller; refuse what does not go together."""
        from evenlight.method.online.controller import ControllerSettings
        from evenlight.method.online.governor import HORIZONS
        from evenlight.method.online.lookahead import LOOKAHEADS

        if self.target_loss is None and self.budget is None:
            raise InputError(
                "give `target_loss`, the contrast loss to hold, or `budget`, which it is to follow"
            )
        if self.budget is None and self.budget_unit is not None:
            raise ArgumentError("budget_unit", "is for `budget`, which is not given")
        bounds = {
            "target_loss": (0.0, 1.0),
            "start_factor": (min_factor, 1.0),
            **dict.fromkeys(GAINS, (0.0, 1e6)),
            "lookahead": LOOKAHEADS,
            "horizon": HORIZONS,
        }
        for name, ends in bounds.items():
            if (value := getattr(self, name)) is not None:
                number(name, value, *ends)
        gains = self.gains
        if self.lookahead is not None and gains:
            raise ArgumentError(
                next(iter(gains)), "is for the PID controller; `lookahead` does without: leave one"
            )
        return ControllerSettings(self.target_loss or 0.0, lowest_factor=min_factor, **gains)

    def posed(self, on: Dimmed, curves: File | None = None) -> tuple[Display, Request]:
        """Return the display, and the request on it; refuse a budget that nothing can meet."""
        from evenlight.method.optimizer.request import require_possible

        display = on.shown_on(curves)
        budget, unit = self.budget, BudgetUnit.FACTOR if self.budget_unit is None else self.budget_unit
        request = on.within(1.0 if budget is None else budget, unit, display)
        if budget is not None:
            require_possible(request, on.min_factor)
        return display, request

    @property
    def seconds(self) -> float:
        """Over which the mean is to meet the budget, and gain is judged [s]."""
        from evenlight.method.online.governor import HORIZON

        return HORIZON if self.horizon is None else self.horizon

    def governor(self, request: Request) -> GovernorSettings | None:
        """Return what moves the target; None without a budget."""
        from evenlight.method.online.governor import GovernorSettings

        if self.budget is None:
            return None
        return GovernorSettings(self.budget, request.budget_unit, self.seconds)

    @property
    def known_ahead(self) -> LookaheadSettings | None:
        """What is known of what comes; None for the PID controller."""
        from evenlight.method.online.lookahead import LookaheadSettings

        return None if self.lookahead is None else LookaheadSettings(self.lookahead, self.seconds)


@dataclass(frozen=True, kw_only=True)
class LoopRequest(Dimmed, Steered):
    """What `OnlineController` is asked, which dims frames as they come."""

    fps: Annotated[
        float, viewing(help="Frames per second of the loop, where `step` is not told how long a frame lasts.")
    ] = 60.0
    resolution: Annotated[
        Member[Resolution],
        computation(
            help="What `step` measures loss on: full, every pixel; strips, of bands with many pixels one "
            "strip of rows in eight (erred by up to 0.003); half or quarter, so many of the pixels each way, "
            "without the one or two finest bands. These two find less loss: in films by 0.003 or 0.009 in "
            "the median and up to 0.03 or 0.09, of finer patterns none. They save most of whole numbers "
            "where both sides divide by 2 or 4."
        ),
    ] = Resolution.FULL

    @property
    def strips_and_halvings(self) -> tuple[int, int]:
        """Of how many strips of rows one is counted, and how often pixels are halved each way before."""
        chosen = choice("resolution", self.resolution, Resolution)
        if self.lookahead is not None and chosen is not Resolution.FULL:
            raise ArgumentError("resolution", "is for `step`; with `lookahead` every pixel is counted")
        if chosen is Resolution.FULL:
            return EVERY_PIXEL
        return ONE_STRIP_IN, {Resolution.STRIPS: 0, Resolution.HALF: 1, Resolution.QUARTER: 2}[chosen]
