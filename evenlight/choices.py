"""The choices that arguments have, as enums; their values, such as "safe", are taken in their place.

These names stay; the modules that they come from may change.
"""

from evenlight.data_schema.power_model import PanelKind
from evenlight.data_schema.rate_limit import BandKind, RateLimitForm, RateLimitModel, Sigmoid
from evenlight.data_schema.recordings.ramp import Direction, Procedure
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.film_reading import Damaged
from evenlight.method.choices import (
    Device,
    LimitCurve,
    ModulatedLuminance,
    ObjectiveName,
    Resolution,
    SolverName,
)

__all__ = [
    "Actuator",
    "BandKind",
    "BudgetUnit",
    "Damaged",
    "Device",
    "Direction",
    "LimitCurve",
    "ModulatedLuminance",
    "ObjectiveName",
    "PanelKind",
    "Procedure",
    "RateLimitForm",
    "RateLimitModel",
    "Resolution",
    "Sigmoid",
    "SolverName",
]
