"""The kinds of rate limits, and of their bands."""

import enum


class RateLimitModel(enum.Enum):
    """How answers became a curve."""

    JOINT = "joint"  # all answers at once, participants and shape included; the default
    INDIVIDUAL = "individual"  # a threshold for each participant and level, then a curve through them
    POOLED = "pooled"  # all answers of a level as if of one person, then a curve; a reading of the paper


class Sigmoid(enum.Enum):
    """What a psychometric function of ln(rate) is, between its asymptotes."""

    LOGISTIC = "logistic"
    NORMAL = "normal"  # the normal distribution function
    WEIBULL = "weibull"  # 1 - exp(-exp z): Weibull's of the rate


class BandKind(enum.Enum):
    """What a band holds with the confidence stated."""

    POINTWISE = "pointwise"  # the curve at any one luminance
    SIMULTANEOUS = "simultaneous"  # the whole curve, at all luminances at once


class RateLimitForm(enum.Enum):
    """What the polynomial describes, and over what."""

    LN_RATE = "ln_rate"  # ln(rate) over luminance: positive by construction; the default
    RATE = "rate"  # the rate itself over luminance
    LOG_LOG = "log_log"  # ln(rate) over ln(luminance): degree 1 is a power law
