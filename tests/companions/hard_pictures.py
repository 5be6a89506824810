"""Pictures that loss curves are tested with: what videos are made of, and what is hard."""

import numpy as np


def fractal(shape, exponent, seed=0):
    """Gaussian noise of amplitude 1/f^exponent, as in photographs; mean 0, standard deviation 1."""
    f = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))
    f[0, 0] = np.inf
    white = np.random.default_rng(seed).normal(size=shape)
    noise = np.fft.irfft2(np.fft.rfft2(white) / f**exponent, shape)
    return (noise - noise.mean()) / noise.std()


def letters(shape, seed=0):
    """Strokes one pixel wide in cells of 8 x 14: text of the size of a terminal's."""
    rng, page = np.random.default_rng(seed), np.zeros(shape)
    for y in range(4, shape[0] - 12, 14):
        for x in range(4, shape[1] - 8, 8):
            page[y : y + 9, x + rng.integers(6)] = 1
            page[y + rng.integers(9), x : x + 6] = 1
    return page


def pictures(shape=(180, 320)):
    """Pixel values in [0, 1]: what videos are made of, and what is hard."""
    x = np.linspace(0, 1, shape[1]) * np.ones(shape)
    pane = np.ones((shape[0] // 6, shape[1] // 10))  # so `shape` is in multiples of these
    windows = np.kron(np.random.default_rng(1).random((6, 10)) > 0.8, pane)
    return {
        "photograph": 0.5 + 0.2 * fractal(shape, 1.0),
        "smooth": 0.5 + 0.2 * fractal(shape, 1.5),
        "dark scene": 0.03 + 0.02 * fractal(shape, 1.0),
        "high dynamic range": np.exp(1.2 * fractal(shape, 1.2)) / 20,
        "white letters": letters(shape),
        "black letters": 1 - letters(shape),
        "faint letters": 0.5 + 0.05 * letters(shape),
        "gradients": x * x[:, ::-1] * np.linspace(0, 1, shape[0])[:, None],
        "edge of the shade": np.where(x > 0.5, 0.9, 0.05) * (1 + 0.1 * fractal(shape, 0.8)),
        "lit windows": windows * (0.6 + 0.2 * fractal(shape, 1.0)),
        "stars": (np.random.default_rng(3).random(shape) > 0.999) * 1.0,
        "noise": np.random.default_rng(4).random(shape),
    }


def frame_of(picture):
    """An 8-bit colour frame of a picture in [0, 1]."""
    gray = np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8)
    return np.repeat(gray[..., None], 3, axis=2)
