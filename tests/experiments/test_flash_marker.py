"""The flashes before and after a measured video."""

from types import SimpleNamespace

from evenlight.experiments.playback.measured_play import flash
from evenlight.method.preset_files import load_display

REFRESH_RATE = 60.0


class Noting:
    """What is shown on, and who takes note of it, in one order."""

    def __init__(self):
        self.rig = SimpleNamespace(refresh_rate=REFRESH_RATE)
        self.display = load_display("varjo-xr3")
        self.brightness = SimpleNamespace(of_picture=lambda factor: factor)
        self.done = []

    def show(self, fields, field, refresh):
        self.done.append("shown")

    def flashed(self, factor):
        self.done.append(factor)

    def take_samples(self):
        self.done.append("sampled")


def test_a_meter_is_sampled_after_every_refresh_for_a_polled_one_has_no_other_samples():
    noting = Noting()
    flash(noting, None, noting)
    assert set(noting.done[::2]) == {"shown"}
    assert "shown" not in noting.done[1::2]
    assert len(noting.done) == 2 * 7 * round(0.5 * REFRESH_RATE)


def test_the_brightness_is_told_as_it_changes():
    noting = Noting()
    flash(noting, None, noting)
    assert [each for each in noting.done if isinstance(each, float)] == [0.2, 1.0, 0.2, 1.0, 0.2, 1.0, 0.2]
