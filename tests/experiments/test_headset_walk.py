"""A walk in a headset: where stick and head lead, and that dimming keeps to the rate limit in real time."""

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import count, pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from played_in_headset import make_yard, watch
from scipy.spatial.transform import Rotation

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Eye
from evenlight.experiments.playback import player, walk_request
from evenlight.experiments.playback.headset_dimming import HeadsetDimmer, largest_change
from evenlight.experiments.playback.headset_walk import HeadsetWalk, turned
from evenlight.experiments.playback.live_dimming import LiveDimmer
from evenlight.experiments.playback.loss_meters import LossMeter
from evenlight.experiments.playback.play_options import LiveOptions, WalkOptions
from evenlight.experiments.playback.walk import SPEED, Walk, Walker
from evenlight.experiments.playback.walk_request import walk_as_asked
from evenlight.hardware.presentation.headset_views import HeadsetFrame, Pose
from evenlight.hardware.protocols import InstrumentError, KeyPress
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.simulated.headset import HeadsetScript, SimulatedHeadset
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.preset_files import load_display, load_rate_limit
from evenlight.method.rate_limit import scalar_rate_limit
from evenlight.stimuli.eyes.eye_views import eye_views
from evenlight.stimuli.scenes.engine.camera import EyeView
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer

DISPLAY = load_display("varjo-xr3")
LIMIT = scalar_rate_limit(load_rate_limit("surace2025"))
EYE_SIZE = (80, 64)


@pytest.fixture(scope="module", autouse=True)
def _yard(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        make_yard(patched, tmp_path_factory.mktemp("yard"))
        yield


@pytest.fixture
def walk_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Walk in the yard with a script, and return the walk, and what was said of it."""

    def walking(script: HeadsetScript, seconds: float, live: LiveOptions | None = None, **more) -> Walk:
        rig = replace(
            load_rig("simulated-headset")[0], window_size=EYE_SIZE, full_screen=False, eye=Eye.RIGHT
        )
        headset = SimulatedHeadset(EYE_SIZE, script=script)
        monkeypatch.setattr(player, "open_headset", lambda rig, **_: headset)
        monkeypatch.setattr(walk_request, "rig_of", lambda *_: (rig, DISPLAY))
        walks: list[Walk] = []
        show = HeadsetWalk._show

        def shown(walk: Walk, *arguments) -> float:
            walks[:] = [walk]
            return show(walk, *arguments)

        monkeypatch.setattr(HeadsetWalk, "_show", shown)
        asked = WalkOptions(scene="yard", rig="headset", seconds=seconds, **more)
        walk_as_asked(asked, live or LiveOptions())
        return walks[0]

    return walking


def facing(azimuth: float) -> Pose:
    """A head that is turned to the right."""
    return Pose(orientation=tuple(Rotation.from_euler("y", -azimuth, degrees=True).as_quat().tolist()))


def test_the_stick_walks_where_the_head_looks_as_fast_as_it_is_pushed(walk_in) -> None:
    """The walk begins at (5, 3) and looks north; the head then turns east; half a push is half the speed."""
    script = HeadsetScript(head=lambda when: facing(90.0 if when > 0.03 else 0.0), stick=lambda _: (0.0, 0.5))
    way = walk_in(script, 1.0).way[1:]
    (begin, first), (end, last) = way[0], way[-1]
    moved = np.subtract(last.position, first.position)
    assert moved == pytest.approx([0.5 * SPEED * (end - begin), 0, 0], abs=2 * SPEED / 90)
    assert moved[0] > 0.6
    assert (last.azimuth, last.altitude) == pytest.approx((90.0, 0.0), abs=1e-6)
    eyes_offset = np.subtract(first.position, (5.0, 3.0, 1.65))[1:]  # the right eye, in the south
    assert eyes_offset == pytest.approx([-0.0315, 0], abs=1e-9)


def test_a_flick_turns_at_once_about_the_head(walk_in) -> None:
    """The head is 1 m to the right of the origin and 0.5 m back; a turn leaves it there."""
    head = Pose((1.0, 0.2, 0.5))
    walker = turned(Walker((5.0, 3.0, 1.65), 0.0), 90.0, frame_with(head))
    # Before: east of the origin by 1 and south by 0.5. One who looks east has his right in the south, and
    # his back in the west: the origin is 1 m north and 0.5 m east of the head.
    assert walker.position == pytest.approx((6.0 + 0.5, 2.5 + 1.0, 1.65))
    assert walker.azimuth == 90.0
    script = HeadsetScript(
        head=lambda _: Pose(), presses=[KeyPress("stick_left", 0.1), KeyPress("stick_right", 0.3)]
    )
    azimuths = [walker.azimuth for _, walker in walk_in(script, 0.5).way]
    changed = [after for before, after in pairwise(azimuths) if after != before]
    assert changed == [330.0, 0.0]


def test_of_focus_views_the_wide_view_counts_with_its_own_pixels_per_degree(walk_in, tmp_path: Path) -> None:
    """The right eye sees from 43 degrees inwards to 47 outwards; its focus view is of 27, and finer."""
    script = HeadsetScript(focus_size=(40, 30))
    walk = walk_in(script, 0.1, LiveOptions(0.02), out=tmp_path / "live", factor=0.8)
    tangents = np.tan(np.radians([47.0, 43.0])).sum()
    assert walk.display.pixels_per_degree == pytest.approx(EYE_SIZE[0] / tangents * np.pi / 180)
    assert [eye.size for eye in walk._stereo.eyes] == [EYE_SIZE, EYE_SIZE, (40, 30), (40, 30)]
    assert walk.pictures is walk._stereo.eyes[1]


def frame_with(head: Pose) -> HeadsetFrame:
    sizes: Any = SimpleNamespace(view_sizes=lambda: 2 * (EYE_SIZE,))  # no headset, which would draw
    return HeadsetFrame(0.0, 1 / 90, SimulatedHeadset._eyes(sizes, head), head, visible=True, tracked=True)


def restless(when: float) -> Pose:
    """A head at rest for a second, then turning slowly, then as fast as heads do (300 degrees a second)."""
    turn = 10 * max(when - 1, 0.0) + 150 * max(np.sin(4 * (when - 2)), 0.0) * (when > 2)
    rotation = Rotation.from_euler("yx", [-turn, 8 * np.sin(6 * when) * (when > 1)], degrees=True)
    sway = 0.05 * np.sin(3 * when) * (when > 1)
    return Pose((sway, 0.0, 0.0), tuple(rotation.as_quat().tolist()))


RESTLESS = HeadsetScript(
    head=restless,
    stick=lambda when: (0.0, np.sin(when) * (when > 1)),
    presses=[KeyPress("stick_right", 1.05 + 0.31 * k) for k in range(9)],
    dropped={k: 1 + k % 3 for k in range(5, 300, 7)},
)


# What is more than 0.7 to the right: a sixth of the right eye's picture.
SIDE = (0.7, -50.0), (0.7, 50.0), (50.0, 0.0)


def test_what_the_lenses_hide_may_change_in_the_midst(walk_in, tmp_path: Path, monkeypatch) -> None:
    facts, calls, states = SimulatedHeadset.facts, count(), (((), ()), ((), (SIDE,)))
    monkeypatch.setattr(
        SimulatedHeadset, "facts", lambda self: replace(facts(self), hidden=states[next(calls) > 20])
    )
    walk = walk_in(HeadsetScript(), 0.5, LiveOptions(0.02), out=tmp_path / "live", factor=0.8)
    assert next(calls) > 50
    assert walk.dimmer.light.seen_share == pytest.approx(walk.pictures.seen.mean())
    assert walk.pictures.seen.mean() == pytest.approx(5 / 6, abs=0.05)


@pytest.mark.parametrize(("simulate", "hidden"), [(True, ()), (False, ()), (True, (SIDE,))])
def test_no_step_is_faster_than_the_rate_limit_though_luminance_is_known_late(
    walk_in, simulate: bool, hidden, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between a white wall and a black one, with snap turns and dropped refreshes; from every picture.

    The luminances are those of numpy, of each picture as it was drawn, read back for the test alone.
    """
    true: list[float] = []
    next_factor = LiveDimmer.next_factor
    left, right = np.tan(np.radians([-43, 47]))  # of the right eye
    columns = left + (np.arange(EYE_SIZE[0]) + 0.5) / EYE_SIZE[0] * (right - left)
    seen_columns = (columns < 0.7) | (not hidden)

    def seen(dimmer: LiveDimmer, now: float) -> float:
        pictures: SceneRenderer = dimmer.light._pictures  # type: ignore[attr-defined] # of a headset
        pixels = pictures.pixel_values()[:, seen_columns]
        true.append(float(emitted_luminance(pixels, DISPLAY).mean()))
        return next_factor(dimmer, now)

    monkeypatch.setattr(LiveDimmer, "next_factor", seen)
    asked = {"out": tmp_path / "live", "simulate": simulate, "factor": 0.8}
    walk = walk_in(replace(RESTLESS, hidden=((), hidden)), 4.0, LiveOptions(0.02), **asked)
    rows = walk.dimmer.rows
    assert max(true) > 1.5 * min(true)
    np.testing.assert_allclose([row.mean_luminance for row in rows], true, rtol=1e-3)
    ratios = []
    for before, now, light, next_light in zip(rows, rows[1:], true, true[1:], strict=False):
        rate = abs(now.factor - before.factor) * (light + next_light) / 2
        limit = min(LIMIT(before.factor * light), LIMIT(now.factor * next_light))
        ratios.append(rate / limit / (now.flip_time - before.flip_time))
    assert max(ratios) <= 1 + 1e-6
    share = pytest.approx(1 - seen_columns.mean()) if hidden else None
    assert json.loads((tmp_path / "live" / "live_control.json").read_text()).get("hidden_share") == share
    assert max(ratios) > 0.8  # at rest the limit is used, and nearly so by one who walks straight on
    assert np.median(ratios) > 0.1
    print(f"largest rate ratio {max(ratios):.4f}, median {np.median(ratios):.3f}")
    logged = list(csv.DictReader((tmp_path / "live" / "live_control.csv").read_text().splitlines()))
    assert max(abs(float(row["rate_cd_m2_s"])) / float(row["rate_limit_cd_m2_s"]) for row in logged[1:]) <= 1


def test_a_refresh_of_a_dimmed_walk_waits_for_nothing_where_the_graphics_card_measures(
    walk_in, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The sums are read into a buffer of the graphics card; what is read is what was filled two pictures ago.

    The loss is measured here by a meter that is never done, so that only the luminance counts.
    """

    class NeverDone(LossMeter):
        name = "never done"

        def __init__(self, *_, light, **__) -> None:
            self._light = light

        def begin(self, factor: float) -> bool:
            return True

        def result(self) -> None:
            return None

        def close(self) -> None:
            """Nothing to let go of."""

    monkeypatch.setattr(walk_request, "open_meter", NeverDone)
    given = watch(monkeypatch, read=False)
    walk_in(HeadsetScript(), 0.2, LiveOptions(0.1), simulate=True)
    for one in given[3:]:
        assert dict(one.counts) == {"VertexArray.render": 11, "Framebuffer.read_into": 1, "Buffer.read": 1}
    assert given[0].counts["Framebuffer.read"] == given[0].counts["Texture.read"] == 0


@pytest.mark.parametrize("fast", [0.5, 3.0, 20.0])
def test_a_turn_changes_the_mean_by_no_more_than_its_bound(fast: float) -> None:
    """Of pictures from 3 to 110 degrees wide apart; what is seen is between black and the display's peak."""
    from played_in_headset import yard

    rng = np.random.default_rng(1)
    with offscreen_context() as context:
        renderer = SceneRenderer(context, yard(1), (48, 48), None)
        for _ in range(12):
            first = Rotation.random(random_state=rng)
            axis = rng.normal(size=3)
            second = Rotation.from_rotvec(np.radians(fast) * axis / np.linalg.norm(axis)) * first
            views, means = [], []
            for turn in (first, second):
                frame = frame_with(Pose(orientation=tuple(turn.as_quat().tolist())))
                middle = replace(eye_views(frame, (5.0, 3.0, 1.65), 0.0)[0], position=(5.0, 3.0, 1.65))
                renderer.render(middle)
                renderer.encode()
                views.append(middle)
                means.append(float(emitted_luminance(renderer.pixel_values(), DISPLAY).mean()))
            bound = largest_change(*views) * DISPLAY.peak_luminance
            assert abs(means[1] - means[0]) <= bound


@pytest.mark.parametrize("widest", [90.0, 130.0, 150.0])
@pytest.mark.parametrize("inwards", [1.0, 0.8])
def test_the_bound_is_as_large_as_the_worst_scene_asks_for(widest: float, inwards: float) -> None:
    """It is bright where the turn stretches and lets light in, and dark where it takes light away."""
    t, turn, count = np.tan(np.radians(widest / 2)), np.radians(0.4), 3000
    left, right, down, up = edges = (-t, inwards * t, -t, t)
    middles = (np.arange(count) + 0.5) / count
    y, x = np.meshgrid(down + (up - down) * middles, left + (right - left) * middles, indexing="ij")
    leaving = np.tan(np.arctan(right) - turn)

    def mean(angle: float) -> float:
        """Of a picture of the scene from a view that is turned to the left."""
        ahead = np.cos(angle) + x * np.sin(angle)
        seen_x, seen_y = (x * np.cos(angle) - np.sin(angle)) / ahead, y / ahead
        within = (seen_x > left) & (np.abs(seen_y) < t)
        stays = (seen_x < leaving) & (np.abs(seen_y) * (1 + seen_x * turn) < t)
        return float(np.mean(~within | ((seen_x > 0) & stays)))

    before = EyeView((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), edges)
    sine, cosine = np.sin(turn), np.cos(turn)
    now = replace(before, right=(cosine, sine, 0.0), forward=(-sine, cosine, 0.0))
    assert 0.95 <= (mean(turn) - mean(0.0)) / largest_change(before, now) <= 1.01


def test_what_there_is_of_a_walk_is_kept_if_the_runtime_goes_away(walk_in, tmp_path: Path) -> None:
    log = tmp_path / "frames.csv"
    with pytest.raises(InstrumentError, match="the runtime went away"):
        walk_in(HeadsetScript(lost_at=20), 1.0, log=log)
    assert len(log.read_text().splitlines()) > 15
    with pytest.raises(InputError, match="--field-of-view is of a window"):
        walk_in(HeadsetScript(), 1.0, field_of_view=90.0)


def test_a_headset_dims_by_its_own_dimmer_which_keeps_the_views_that_it_needs(walk_in) -> None:
    dimmer = walk_in(HeadsetScript(), 0.3, LiveOptions(0.1), simulate=True).dimmer
    assert isinstance(dimmer, HeadsetDimmer)
    assert len(dimmer.rows) > 20
    assert len(dimmer._views) == 3  # of the last picture whose luminance is known, and two later ones


def test_a_dimmed_walk_is_kept_if_its_last_luminances_cannot_be_taken(
    walk_in, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(_: HeadsetDimmer) -> None:
        raise InstrumentError("the graphics card went away")

    monkeypatch.setattr(HeadsetDimmer, "finish", lost)
    with pytest.raises(InstrumentError, match="the graphics card went away"):
        walk_in(HeadsetScript(), 0.1, LiveOptions(0.1), log=tmp_path / "log.csv")
    assert len((tmp_path / "log.csv").read_text().splitlines()) > 5
