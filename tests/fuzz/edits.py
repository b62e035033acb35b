"""Valid files made wrong: small edits of bytes, lines and numbers, as data that hypothesis can draw and shrink."""

import re

from hypothesis import strategies as st

NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
NUMBERS = (
    b"nan", b"-inf", b"1e308", b"-1", b"0", b"1e-320", b"99999999999", b"18446744073709551616", b"1" + b"0" * 400
)  # fmt: skip
TEXTS = (
    b"\x00", b"\xff\xfe", b"\xe2\x80\xa8", b"\x1b]0;x\x07", b"\r", b"<script>", b"[" * 3000, b'"', b"'''", b"=", b",",
    b"\n\n", b"../../../etc/passwd", b"\xed\xa0\x80", b"e", b"-", b" ", b"{", b"\x7f", b"\xc2\x85",
)  # fmt: skip
SIZES = (0, 1, 0x7F, 0xFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF)


def flip(data, where, what):
    at = int(where * (len(data) - 1))
    return data[:at] + bytes([data[at] ^ (1 + what % 255)]) + data[at + 1 :]


def cut(data, where, what):
    return data[: int(where * len(data))]


def leave_out(data, where, what):
    at = int(where * len(data))
    return data[:at] + data[at + 1 + what % 64 :]


def insert(data, where, what):
    at = int(where * len(data))
    return data[:at] + TEXTS[what % len(TEXTS)] + data[at:]


def lie(data, where, what):
    """A number of 1 to 8 bytes, such as a size, is another one."""
    at, size = int(where * len(data)), (1, 2, 4, 8)[what % 4]
    return data[:at] + SIZES[what // 4 % len(SIZES)].to_bytes(8, "little")[:size] + data[at + size :]


def renumber(data, where, what):
    found = list(NUMBER.finditer(data))
    if not found:
        return flip(data, where, what)
    match = found[int(where * (len(found) - 1))]
    return data[: match.start()] + NUMBERS[what % len(NUMBERS)] + data[match.end() :]


def repeat_line(data, where, what):
    lines = data.split(b"\n")
    at = int(where * (len(lines) - 1))
    return b"\n".join(lines[:at] + lines[at : at + 1] * (2 + what % 2 * 500) + lines[at + 1 :])


def drop_line(data, where, what):
    lines = data.split(b"\n")
    at = int(where * (len(lines) - 1))
    return b"\n".join(lines[:at] + lines[at + 1 :])


def swap_lines(data, where, what):
    lines = data.split(b"\n")
    at, other = int(where * (len(lines) - 1)), what % len(lines)
    lines[at], lines[other] = lines[other], lines[at]
    return b"\n".join(lines)


BINARY = (flip, cut, leave_out, insert, lie)
TEXTUAL = (*BINARY, renumber, renumber, repeat_line, drop_line, swap_lines)


def edited(data, edits):
    """The bytes after all edits ``(function, place in the file from 0 to 1, variant)``."""
    for function, where, what in edits:
        if data:
            data = function(data, where, what)
    return data


def edits(kinds):
    return st.lists(st.tuples(st.sampled_from(kinds), st.floats(0, 1), st.integers(0, 2**16)), min_size=1, max_size=4)
