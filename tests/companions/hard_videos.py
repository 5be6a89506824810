"""Short videos of what happens in films, and of what sampling a few of their frames would miss."""

from collections.abc import Callable, Iterator

import numpy as np
from hard_pictures import fractal, frame_of, letters
from scipy import ndimage

from evenlight.data_schema.frame import Frame

SHAPE = (270, 384)  # large enough for its finest band not to be counted in every frame
LENGTH = 33
ODD = 21  # neither an end nor a middle of any stretch of 16, 8 or 4 frames

_LARGE = 0.45 + 0.18 * fractal((400, 800), 1.1)
_OTHER = 0.25 + 0.12 * fractal(SHAPE, 1.0, 2)
_BASE = _LARGE[: SHAPE[0], : SHAPE[1]]
_ROWS, _COLUMNS = np.arange(SHAPE[0])[:, None], np.arange(SHAPE[1])[None]


def _panned(k: int, speed: int = 3) -> np.ndarray:
    return np.roll(_LARGE, -speed * k, 1)[100 : 100 + SHAPE[0], : SHAPE[1]]


def _noise(k: int) -> np.ndarray:
    return np.random.default_rng(k).normal(size=SHAPE)


def _titled(k: int) -> np.ndarray:
    page = _BASE.copy()
    if k >= ODD:
        page[200:260, 40:340] = np.maximum(page[200:260, 40:340], letters((60, 300)))
    return page


def _patched() -> np.ndarray:
    page = _BASE.copy()
    page[100:120, 60:300] += 0.1 * _noise(0)[:20, :240]
    return page


def _odd(picture: np.ndarray) -> Callable[[int], np.ndarray]:
    """One frame of something else in a shot that stands still but for faint grain."""
    return lambda k: picture if k == ODD else _BASE + 0.004 * _noise(k)


PICTURES: dict[str, Callable[[int], np.ndarray]] = {
    "standing still": lambda k: _BASE,
    "flash": lambda k: np.minimum(_BASE * (2.5 if k == ODD else 1), 1),
    "weak flash": _odd(1.03 * _BASE),
    "cut": lambda k: _BASE if k < ODD else _OTHER,
    "shot of two frames": lambda k: _OTHER if k in (ODD, ODD + 1) else _BASE,
    "fade to black": lambda k: _BASE * (1 - k / (LENGTH - 1)),
    "fast fade": lambda k: _BASE * np.clip((k - ODD) / 5, 0, 1),
    "cross-fade": lambda k: _BASE + (_OTHER - _BASE) * k / (LENGTH - 1),
    "pan": _panned,
    "fast pan": lambda k: _panned(k, 17),
    "pan that starts": lambda k: _panned(max(k - ODD, 0)),
    "blurred frame in a pan": lambda k: ndimage.gaussian_filter(_panned(k), 0.8 * (k == ODD)),
    "title": _titled,
    "scrolling text": lambda k: np.roll(letters(SHAPE), -2 * k, 0),
    "noise": lambda k: np.random.default_rng(k).random(SHAPE),
    "grain": lambda k: _BASE + 0.03 * _noise(k),
    "grain that comes and goes": lambda k: _BASE + 0.03 * np.sin(k) * _noise(k),
    "odd rows": _odd(_BASE + 0.02 * (_ROWS % 2 * 2 - 1)),
    "odd columns": _odd(_BASE + 0.03 * (_COLUMNS % 2 * 2 - 1)),
    "odd checks": _odd(_BASE + 0.04 * ((_ROWS + _COLUMNS) % 2 * 2 - 1)),
    "odd patch": _odd(_patched()),
    "odd blur": _odd(ndimage.gaussian_filter(_BASE, 1)),
    "odd grain": _odd(_BASE + 0.02 * _noise(99)),
    "flicker": lambda k: _BASE * (1 + 0.05 * (-1) ** k),
    "shutter": lambda k: _BASE if k % 2 else _OTHER,
    "something every eighth frame": lambda k: _OTHER if k % 8 == 3 else _BASE,
    "focus": lambda k: ndimage.gaussian_filter(_BASE, 0.1 + 2 * abs(np.sin(k / 9))),
    "grating": lambda k: 0.5 + 0.2 * np.sin(2 * np.pi * _COLUMNS * (0.01 + 0.4 * k / LENGTH)) + 0 * _ROWS,
    "darkness": lambda k: (0.02 + 0.02 * _OTHER) * (1 + 0.2 * np.sin(k)),
    "halves that swap": lambda k: _BASE * np.where((_COLUMNS < 192) == (k % 5 == 2), 1.3, 0.7),
}


def frames_of(pictures: Iterator[np.ndarray]) -> Iterator[Frame]:
    """Frames of 0.04 s."""
    for k, picture in enumerate(pictures):
        yield Frame(0.04 * k, 0.04, frame_of(picture))


def hard_video(name: str) -> Iterator[Frame]:
    """Yield the frames of a kind of video."""
    return frames_of(PICTURES[name](k) for k in range(LENGTH))
