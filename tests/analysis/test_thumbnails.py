"""Claims about the small pictures of a video: averages of light, and as many as there are."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.tracks.frame_samples import small_picture, thumbnails_of


def test_a_small_picture_averages_squares_of_pixels() -> None:
    frame = np.zeros((2, 4, 3), np.uint16)
    frame[:, :2] = 65535  # the left square is white, the right one half white
    frame[0, 2:] = 65535
    assert small_picture(frame, width=2)[..., 0].tolist() == [[255, 128]]


def test_a_frame_no_wider_than_asked_keeps_its_pixels() -> None:
    frame = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    np.testing.assert_array_equal(small_picture(frame, width=3), frame)


def test_fewer_samples_than_thumbnails_are_all_taken() -> None:
    frame = np.zeros((2, 2, 3), np.uint8)
    assert [index for index, _ in thumbnails_of([(7, frame), (9, frame)], count=6)] == [7, 9]
    assert thumbnails_of([], count=6) == ()
