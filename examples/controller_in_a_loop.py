"""The online controller in a render loop of one's own, with frames that this script makes."""

import numpy as np

import evenlight

controller = evenlight.OnlineController(target_loss=0.05, fps=90)
texture = np.random.default_rng(1).random((120, 160, 1)).repeat(3, axis=2)
for number in range(180):  # two seconds of a scene that becomes darker
    frame = (texture * (1 - 0.7 * number / 180)).astype(np.float32)  # gamma-encoded R, G, B in [0, 1]
    factor = controller.step(frame)
    # Show the frame dimmed in linear light: by the backlight, or as (factor * frame**gamma)**(1/gamma).
    if number % 30 == 0:
        print(f"frame {number:3d}: factor {factor:.3f}, contrast loss {controller.loss:.3f}")
