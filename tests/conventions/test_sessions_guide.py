"""The guide to sessions says what laboratories have missed in it, in the words of the commands."""

from pathlib import Path

import pytest

import evenlight
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.method.choices import LimitCurve

GUIDE = " ".join((Path(evenlight.__file__).parents[1] / "docs/sessions.md").read_text().split())
LONGEST = 220  # lines


@pytest.mark.parametrize(
    "said",
    [
        "Sessions are shown on a monitor",
        'or [in a headset](headset.md) (`screen = "openxr"`)',
        "Every luminance of a session comes from this file",
        f"`--form {RateLimitForm.LOG_LOG.value} --degree 1`",
        f"`--limit-curve {LimitCurve.SAFE.value}`",
        "The joint model's band is simultaneous",
        "With `--model individual` or `pooled` it is pointwise",
        "A rig names keys by what is printed on them",
        "--font NotoSansJP-Regular.ttf",
    ],
)
def test_the_guide_says(said: str) -> None:
    assert said in GUIDE


def test_the_guide_is_no_book() -> None:
    text = (Path(evenlight.__file__).parents[1] / "docs/sessions.md").read_text()
    assert text.count("\n") <= LONGEST
