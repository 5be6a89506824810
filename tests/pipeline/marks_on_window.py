"""Shows a ramp, a question, a video and a search on a real window with a photodiode's corner and triggers.

It prints, as JSON, what each flip had in its corner and in the middle, and after which flip a trigger came:
run in a process of its own, for PsychoPy warns.
"""

import dataclasses
import json
from typing import Any

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.recordings.rig import Corner, PhotodiodePatch
from evenlight.experiments.sessions import search_stage
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import Clip, RampInterval, SearchView
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.rig_windows import open_window
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.scenes.engine.camera import Camera

LAB = Display("lab", 100.0, 0.2, 2.2, pixels_per_degree=12.0, reflected_luminance=0.5)
SIZE, SIDE = (320, 240), 40
RAMP = RampInterval(60.0, 40.0, 1.0, adaptation=0.2, duration=0.5, hold=0.1, noise_seed=3)
VIEW = SearchView(
    scene="gray",
    camera=Camera((1.0, 2.0, 1.65), azimuth=355.0, altitude=-5.0),
    ring=Ring(azimuth=357.0, altitude=-4.0, gap=15.0, contrast=-0.4, orientation=90),
    factor=0.5,
    time_limit=0.3,
    field_of_view=15.0,
    noise_seed=7,
)


class Gray:
    """A scene that is gray everywhere, in the stead of one whose light would have to be baked."""

    def __init__(self, context: Any, scene: object, size: tuple[int, int], **_: object) -> None:
        self.size, self.codes = size, context.texture(size, 4, dtype="u2")

    def render(self, camera: Camera) -> None:
        pass

    def encode(self) -> None:
        self.codes.write(np.full((self.size[1], self.size[0], 4), 600, np.uint16).tobytes())


class GrayVideo:
    """15 frames of gray."""

    name, n_frames = "gray", 15

    def frames(self):
        for k in range(15):
            yield Frame(k / 30, 1 / 30, np.full((64, 64, 3), 128, np.uint8))

    def sha256(self) -> str:
        return ""


class Witness:
    """A window that reads back every frame before it is shown, and a device that takes triggers."""

    def __init__(self, window: Any) -> None:
        self._window = window
        self.flips: list[dict[str, Any]] = []
        self.triggers: list[tuple[int, str, int]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._window, name)

    def flip(self) -> float:
        codes = self._window.read_codes()
        corner = codes[:SIDE, -SIDE:]
        beside = [codes[: SIDE + 1, -SIDE - 1], codes[SIDE, -SIDE - 1 :]]  # the pixels around the corner
        self.flips.append(
            {
                "corner": sorted(set(corner.ravel().tolist())),
                "beside": [int(np.min(beside[0])), int(np.max(beside[1]))],
                "middle": codes[88:152, 128:192].ravel().tolist() if len(self.flips) < 48 else [],
            }
        )
        return float(self._window.flip())

    def send(self, code: int, label: str) -> None:
        self.triggers.append((code, label, len(self.flips)))

    def apparatus(self) -> dict[str, str]:
        return {}


def main() -> None:
    rig = dataclasses.replace(
        load_rig("simulated")[0], window_size=SIZE, photodiode_patch=PhotodiodePatch(Corner.TOP_RIGHT, SIDE)
    )
    search_stage.SceneRenderer, search_stage.scene_searched = Gray, lambda name: name
    times = np.arange(15) / 30
    clip = Clip(GrayVideo(), times, 0.5, np.full(15, 0.8), 9)
    with open_window(rig, RefreshClock(60.0)) as window:
        seen, keyboard = Witness(window), SimulatedKeyboard(window.now)
        with WindowStage(seen, keyboard, rig, LAB, 20.0, triggers={"witness": seen}) as stage:
            shown = {"ramp": stage.show_ramp(RAMP)}
            counts = {"ramp": len(seen.flips)}
            keyboard.queue("y", 0.105)
            stage.ask("Did it change?", ["y"], 40.0)
            counts["question"] = len(seen.flips)
            stage.wait(0.1, 30.0)
            counts["wait"] = len(seen.flips)
            shown["video"] = stage.play(clip)
            counts["video"] = len(seen.flips)
            stage.wait(0.1, 30.0)
            counts["wait again"] = len(seen.flips)
            shown["search"] = stage.search(VIEW)
            counts["search"] = len(seen.flips)
            stage.wait(0.1, 30.0)
            sent = [dataclasses.asdict(each) for each in stage.triggers_sent()]
    onsets = {name: part.onset for name, part in shown.items()}
    lengths = {name: len(part.flip_times) for name, part in shown.items()}
    result = {"flips": seen.flips, "triggers": seen.triggers, "counts": counts, "sent": sent}
    intended = shown["ramp"].intended_luminance
    print(json.dumps(result | {"onsets": onsets, "lengths": lengths, "intended": intended}))


if __name__ == "__main__":
    main()
