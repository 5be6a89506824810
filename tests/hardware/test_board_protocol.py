"""The lines of our power board: their checksum, what is no sample, and how long they may be."""

import pytest

from evenlight.hardware.drivers import board_protocol as protocol


def test_any_single_bit_that_flips_in_a_line_is_found() -> None:
    line = protocol.with_checksum("P 65535 4294967295 1800000 1").rstrip(b"\n")
    for place in range(len(line)):
        for bit in range(8):
            flipped = line[:place] + bytes([line[place] ^ 1 << bit]) + line[place + 1 :]
            assert protocol.checked_body(flipped.decode("latin-1")) is None


def test_any_two_bytes_that_change_places_are_found() -> None:
    # An XOR over the line would not see it: that is why the checksum is a CRC.
    line = protocol.with_checksum("P 4711 1234567890 672301 1").decode().rstrip("\n")
    for place in range(len(line) - 1):
        if line[place] != line[place + 1]:
            swapped = line[:place] + line[place + 1] + line[place] + line[place + 2 :]
            assert protocol.checked_body(swapped) is None


@pytest.mark.parametrize("body", ["P 1 2 3", "P 1 2 3 G", "P 65536 2 3 0", "P 1 4294967296 3 0", "Q 1 2 3 0"])
def test_a_body_that_is_no_sample_is_refused(body) -> None:
    with pytest.raises(ValueError):
        protocol.parse_sample(body)


def test_no_line_of_a_sample_is_longer_than_the_rate_limit_reckons_with() -> None:
    longest = protocol.with_checksum("P 65535 4294967295 -99999999 F")
    assert len(longest) == protocol.LONGEST_SAMPLE == 36
    # 115200 baud are 11520 bytes a second; 85 % of them in lines of 36 bytes
    assert protocol.fastest_over(115_200) == pytest.approx(0.85 * 11520 / 36)
