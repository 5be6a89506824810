"""H.264 of which each field is a picture of its own, as camcorders write it; FFmpeg encodes none."""

import numpy as np

FRAMES, WIDTH, HEIGHT = 16, 64, 64


class _Bits:
    """Bits of a NAL unit, in the codes of H.264, 7.2 and 9.1."""

    def __init__(self):
        self.bits = []

    def fixed(self, *pairs):
        for count, value in pairs:
            self.bits += [value >> place & 1 for place in reversed(range(count))]
        return self

    def coded(self, *values):
        for value in values:
            length = (value + 1).bit_length()
            self.fixed((length - 1, 0), (length, value + 1))
        return self

    def aligned(self):
        return self.fixed((-len(self.bits) % 8, 0))

    def unit(self, priority, kind):
        """Return the NAL unit, with the bytes between that keep its content from looking like a start."""
        body, zeros, out = np.packbits(self.fixed((1, 1)).aligned().bits).tobytes(), 0, bytearray()
        for byte in body:
            if zeros >= 2 and byte <= 3:
                out.append(3)
                zeros = 0
            out.append(byte)
            zeros = zeros + 1 if byte == 0 else 0
        return b"\0\0\0\1" + bytes([priority << 5 | kind]) + bytes(out)


def field_pictures() -> bytes:
    """Return 16 frames of two fields each, 64 x 64 at 25 Hz, whose macroblocks hold plain samples (I_PCM)."""
    sequence = _Bits().fixed((8, 77), (8, 0), (8, 30)).coded(0, 4, 0, 4, 1).fixed((1, 0))
    sequence.coded(WIDTH // 16 - 1, HEIGHT // 32 - 1).fixed((1, 0), (1, 0), (1, 1), (1, 0), (1, 1), (4, 0))
    sequence.fixed((1, 1), (32, 1), (32, 50), (1, 1), (4, 0))  # two ticks of 1/50 s a frame
    pictures = _Bits().coded(0, 0).fixed((2, 0)).coded(0, 0, 0).fixed((3, 0)).coded(0, 0, 0).fixed((3, 4))
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    delimiter = _Bits().fixed((3, 0)).unit(0, 9)
    stream = b""
    for k in range(FRAMES):
        luma = 120 + 60 * np.sin((x + 4 * k) / 9) + 40 * np.sin(y / 5 + k / 8)
        parameters = sequence.unit(3, 7) + pictures.unit(3, 8) if k == 0 else b""
        for bottom in (0, 1):
            stream += (
                delimiter + parameters * (1 - bottom) + _field(luma[bottom::2].astype(np.uint8), k, bottom)
            )
    return stream


def _field(luma, k, bottom):
    refreshes = k == 0 and not bottom
    slice_ = _Bits().coded(0, 7, 0).fixed((8, k), (1, 1), (1, bottom))
    if refreshes:
        slice_.coded(0)
    slice_.fixed((8, 2 * k + bottom), (2 if refreshes else 1, 0)).coded(0, 1)
    for row in range(0, luma.shape[0], 16):
        for column in range(0, WIDTH, 16):
            samples = [*luma[row : row + 16, column : column + 16].ravel().tolist(), *[128] * 128]
            slice_.coded(25).aligned().fixed(*((8, sample) for sample in samples))
    return slice_.unit(3, 5 if refreshes else 1)
