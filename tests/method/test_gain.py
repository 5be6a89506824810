"""The warning at run time that nothing is gained over constant dimming."""

import numpy as np
import pytest

from evenlight.method.online.gain import LOSS_EXPONENT, NO_GAIN, GainMonitor, gain_warning


def test_by_definition_where_the_loss_is_as_it_takes_it_to_be() -> None:
    """Loss k (1 - b)^1.5 of content k: that of constant dimming is known exactly; means over all 40 s."""
    rng = np.random.default_rng(1)
    content, factors = rng.uniform(0.05, 0.3, 400), rng.uniform(0.4, 0.8, 400)
    loss = content * (1 - factors) ** LOSS_EXPONENT
    monitor = GainMonitor(40.0)
    for k in range(400):
        assert monitor.ratio is None  # before a horizon has passed
        monitor.take(factors[k], loss[k], 0.1)
    constant = content * (1 - factors.mean()) ** LOSS_EXPONENT
    assert monitor.ratio == pytest.approx(loss.std() / constant.std(), rel=1e-9)


def test_it_warns_of_constant_dimming_and_not_of_a_loss_that_stays() -> None:
    dull, even = GainMonitor(10.0), GainMonitor(10.0)
    for k in range(200):
        strength = 0.1 + 0.05 * (k % 2)
        dull.take(0.5, strength * 0.5**LOSS_EXPONENT, 0.1)
        even.take(1 - (0.05 / strength) ** (1 / LOSS_EXPONENT), 0.05, 0.1)
    assert dull.ratio == pytest.approx(1.0)
    assert gain_warning(dull.ratio) is not None
    assert even.ratio == pytest.approx(0.0, abs=1e-6)
    assert gain_warning(even.ratio) is None


def test_it_says_nothing_where_nothing_is_known() -> None:
    still = GainMonitor(1.0)
    for _ in range(30):
        still.take(0.5, 0.03, 0.1)  # nothing changes: there is nothing to gain, nor to lose
    assert still.ratio is None
    assert gain_warning(None) is None
    assert gain_warning(NO_GAIN - 1e-9) is None
