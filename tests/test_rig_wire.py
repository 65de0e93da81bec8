"""One line of the spa-rig format."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

import naive_rig
from spa_fo.rig.wire import (
    Banner,
    LineParser,
    checksum,
    format_line,
    is_comment,
    parse_banner,
)

COLUMNS = ("seq", "t_us", "cmd_kpa", "p_adc", "flex_adc")
PARSER = LineParser(COLUMNS)


def test_the_lines_of_the_contract_are_whole() -> None:
    # As printed in the format's description.
    assert PARSER.parse(b"0,1000012,0.00,93,354*24") == (b"0", b"1000012", b"0.00", b"93", b"354")
    assert PARSER.parse(b"1,1020016,0.00,93,355*22") is not None
    assert format_line(["0", "1000012", "0.00", "93", "354"]) == b"0,1000012,0.00,93,354*24"


@given(st.binary())
def test_the_checksum_is_the_plain_xor(body: bytes) -> None:
    assert checksum(body) == naive_rig.xor_checksum(body)


@given(
    st.integers(0, 10**9),
    st.integers(0, 2**32 - 1),
    st.decimals(-99, 999, places=2),
    st.integers(0, 1023),
    st.integers(0, 1023),
)
def test_lines_survive_the_round_trip(
    seq: int, t_us: int, command: object, p: int, flex: int
) -> None:
    fields = [str(seq), str(t_us), str(command), str(p), str(flex)]
    assert PARSER.parse(format_line(fields)) == tuple(field.encode() for field in fields)


@given(st.data())
def test_a_changed_or_lost_byte_never_passes(data: st.DataObject) -> None:
    line = format_line(["12", "1240003", "20.00", "113", "402"])
    at = data.draw(st.integers(0, len(line) - 1))
    byte = data.draw(st.integers(0, 255))
    changed = line[:at] + bytes([byte]) + line[at + 1 :]
    assert changed == line or PARSER.parse(changed) is None
    assert PARSER.parse(line[:at] + line[at + 1 :]) is None


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (b"", "blank"),
        (b"0,1000012,0.00,93,3", "cut"),
        (b"0,1000012,0.00,93,354*2", "cut"),
        (b"0,1000012,0.00,93,354", "cut"),
        (b"0,1000012,0.00,93,354*25", "checksum"),
        (b"0,1000012,0.00,93,354*24 ", "checksum"),
        (b"0,1000012,0.00,93,354*a4", "checksum"),
        (b"0,1000012,0.00,93,\xff54*24", "not ascii"),
        (b"0,1000012,\x000.00,93,354*24", "not ascii"),
        (b"#comment", "hash"),
        (b"0,1000012#,0.00,93,354*24", "hash"),
        (b" # late", "hash"),
        (naive_rig.data_line(0, 1000012, "0.00", 93), "fields"),
        (naive_rig.data_line(0, 1000012, "0.00", 93, 354, 1), "fields"),
        (naive_rig.data_line(0, 1000012, "nan", 93, 354), "not a number"),
        (naive_rig.data_line(0, 1000012, "", 93, 354), "not a number"),
        (naive_rig.data_line(0, 1000012, "0.00", 93.5, 354), "not a number"),
        (naive_rig.data_line(-1, 1000012, "0.00", 93, 354), "not a number"),
        (naive_rig.data_line(0, "9" * 5000, "0.00", 93, 354), "not a number"),
        (naive_rig.data_line(0, 1000012, "0.00", 93, "354*"), "not a number"),
    ],
)
def test_damaged_lines_have_a_reason(line: bytes, reason: str) -> None:
    assert PARSER.parse(line) is None
    assert PARSER.reason(line) == reason


def test_the_lower_case_checksum_is_refused() -> None:
    # Two upper-case digits are the format; a lower-case one did not come from the board.
    lines = [naive_rig.data_line(seq, 1, "0", 1, 1) for seq in range(100)]
    letters = next(line for line in lines if line[-1:].isalpha())
    assert PARSER.parse(letters) is not None
    assert PARSER.parse(letters[:-2] + letters[-2:].lower()) is None


def test_the_banner_round_trip() -> None:
    banner = parse_banner(naive_rig.BANNER.encode())
    assert banner == Banner("mega2560", 10, 5000.0, 50.0, COLUMNS)
    assert banner.adc_max == 1023
    assert banner.line() == naive_rig.BANNER.encode()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b"hello", "expected the banner"),
        (b"\x7fELF\x00\x01", "expected the banner"),
        (b"# spa-rig 2 adc_bits=10 vref_mv=5000 rate_hz=50 columns=seq", "expected '# spa-rig 1"),
        (b"# spa-rig", "expected '# spa-rig 1"),
        (b"# spa-rigs 1 a=b", "expected '# spa-rig 1"),
        (naive_rig.BANNER.replace("flex_adc", "flex").encode(), "lacks flex_adc"),
        (naive_rig.BANNER.replace("p_adc", "p_acd").encode(), "did you mean 'p_adc'?"),
        (naive_rig.BANNER.replace("p_adc", "p_adx").encode(), "did you mean 'p_adc'?"),
        (naive_rig.BANNER.replace("flex_adc", "flx_adc").encode(), "did you mean 'flex_adc'?"),
        (naive_rig.BANNER.replace("p_adc", "cmd kpa").encode(), "expected key=value"),
        (naive_rig.BANNER.replace("p_adc", "p*").encode(), "unknown column 'p*'; expected one of"),
        (naive_rig.BANNER.replace("t_us,", "").encode(), "lacks t_us"),
        (naive_rig.BANNER.replace(",flex_adc", "").encode(), "lacks flex_adc"),
        (naive_rig.BANNER.replace("p_adc", "seq").encode(), "names a column twice"),
        (naive_rig.BANNER.replace("=10", "=ten").encode(), "adc_bits=ten"),
        (naive_rig.BANNER.replace("=10", "=99").encode(), "adc_bits=99"),
        (naive_rig.BANNER.replace("=5000", "=0").encode(), "vref_mv=0"),
        (naive_rig.BANNER.replace("=50 ", "=nan ").encode(), "rate_hz=nan"),
        (naive_rig.BANNER.replace("rate_hz=50 ", "").encode(), "lacks rate_hz="),
        (naive_rig.BANNER.replace("board=mega2560", "board").encode(), "expected key=value"),
        (naive_rig.BANNER.encode() + b"\xff", "ASCII"),
    ],
)
def test_wrong_banners_say_what_was_expected(line: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=r"expected|unknown|lacks|twice") as caught:
        parse_banner(line)
    assert message in str(caught.value)
    assert str(caught.value).isprintable()


def test_comments() -> None:
    assert is_comment(b"# a note")
    assert not is_comment(b"#note")
    assert not is_comment(b"# \xff")


def test_what_a_board_logs_besides_is_passed_over() -> None:
    for name in ("temp_adc", "t_adc", "i_adc", "angle_ref"):
        banner = parse_banner(naive_rig.BANNER.replace("p_adc", name).encode())
        assert banner.columns == ("seq", "t_us", "cmd_kpa", name, "flex_adc")
    fields = ["1", "20000", "0.0", "warm -3", "512"]
    parsed = LineParser(banner.columns).parse(format_line(fields))
    assert parsed == tuple(field.encode() for field in fields)
    for odd in ("\xb0", "a,b", "1*2", "#"):
        body = ",".join([*fields[:3], odd, fields[4]]).encode("latin-1")
        assert LineParser(banner.columns).parse(body + b"*%02X" % checksum(body)) is None
