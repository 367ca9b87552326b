"""Files changed at random: bytes, numbers that lie, words, lines and parts; the same for the same generator."""

import io
import re
import struct

import numpy as np


def npy(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


NUMBERS = (
    0, 1, -1, 2, 3, 127, 128, 255, 256, 32767, 65535, 10**6, 2**28, 2**31 - 1, 2**31, 2**32 - 1, 2**53 + 1, 2**63 - 1,
    2**63, 2**64 - 1,
)  # fmt: skip
"""Counts, sizes and offsets that parsers get wrong."""
WORDS = (
    b"0", b"-0", b"-1", b"1", b"nan", b"inf", b"-inf", b"1e308", b"1e400", b"1e-320", b"1,5", b"0x10", b"1_000",
    b"2147483648", b"4294967295", b"18446744073709551616", b"9" * 30, b"9" * 5000, b"1:1:1", b"null", b"true", b"~",
    b"", b'"', b"'", b"{}", b"[]", b"{", b"[", b"]", b"[" * 2000, b"&a", b"*a", b"!!python/name:os.system", b"../x",
    b"/dev/zero", b"\0", b"\r", b"\t", b"\xef\xbb\xbf", b"\xff\xfe", "\u0663\u00b2".encode(), "\u2028".encode(),
    b"#", b":", b",",
)  # fmt: skip
"""Words that are no numbers, or no numbers that fit, and signs that text formats are made of."""
LARGEST_BYTES = 1 << 24
"""Lines doubled again and again end here."""
ARRAYS = tuple(
    npy(np.array(values))
    for values in (
        [], 5, True, 2**63, -(2**40), "", "text", "null", "1" * 5000, "[" * 100_000, '{"a": 1e999}', b"x", 1 + 2j,
        [np.nan, -np.inf], ["a", "b"], np.zeros((0, 3), np.float32), np.zeros((2, 2)), np.zeros((1, 1, 1, 1, 1)),
        np.zeros(3, [("a", "<f4")]), np.datetime64("2020-01-01"), np.zeros(2, "U0"),
    )
)  # fmt: skip
"""NumPy files that belong nowhere."""
WORD = re.compile(rb"[^\s,:;\[\]{}()\"'=]+")
DIGITS = re.compile(rb"\d+")
LAYOUTS = ("<B", "<H", "<I", "<Q", ">H", ">I", ">Q")


def mutated(seeds, random_, *, text=False, gentle=0.0):
    """One of `seeds`, each a list of parts of a file, changed at one place or a few.

    The share `gentle` of them is changed only once, and so that what counts and checks there are may hold.
    """
    parts = list(random_.choice(seeds))
    if random_.random() < gentle:
        at = random_.randrange(len(parts))
        parts[at] = random_.choice(GENTLE_TEXT_CHANGES if text else GENTLE_CHANGES)(parts[at], random_, b"")
        return parts
    changes = TEXT_CHANGES + BYTE_CHANGES[:4] if text else BYTE_CHANGES
    n_changes = min(int(random_.expovariate(0.7)) + 1, 8)
    for _ in range(n_changes):
        at = random_.randrange(len(parts))
        other = random_.choice(seeds)
        changed = random_.choice(changes)(parts[at], random_, other[min(at, len(other) - 1)])
        parts[at] = changed[:LARGEST_BYTES]
    return parts


def changed_bytes(content, random_):
    """`content` with a few bytes changed, one cut out or put in, or its end cut off."""
    for _ in range(min(int(random_.expovariate(0.7)) + 1, 8)):
        content = random_.choice(BYTE_CHANGES)(content, random_, content)
    return content


def _place(content, random_):
    return random_.randrange(len(content)) if content else 0


def _slice(content, random_):
    """A short stretch: its start and its end."""
    start = _place(content, random_)
    return start, min(len(content), start + random_.choice((1, 2, 3, 4, 8, 16, 64, len(content))))


def _flip(content, random_, _):
    if not content:
        return content
    at = _place(content, random_)
    return content[:at] + bytes([content[at] ^ (1 << random_.randrange(8))]) + content[at + 1 :]


def _set(content, random_, _):
    at = _place(content, random_)
    return content[:at] + bytes([random_.randrange(256)]) + content[at + 1 :]


def _count(content, random_, _):
    """A whole number of any size in place of the bytes there, or a little more or less than what is there."""
    layout = random_.choice(LAYOUTS)
    size = struct.calcsize(layout)
    at = random_.randrange(max(1, len(content) - size + 1))
    there = int.from_bytes(content[at : at + size], "little" if layout[0] == "<" else "big")
    number = random_.choice((*NUMBERS, len(content), there + 1, there - 1, there * 2, there + random_.randrange(-9, 9)))
    return content[:at] + struct.pack(layout, number % (1 << 8 * size)) + content[at + size :]


def _swap(content, random_, _):
    """Two numbers of the same size in each other's place: their sum stays."""
    size = random_.choice((1, 2, 4, 8))
    one, two = sorted(random_.randrange(max(1, len(content) // size)) * size for _ in range(2))
    if one == two:
        return content
    middle = content[one + size : two]
    return content[:one] + content[two : two + size] + middle + content[one : one + size] + content[two + size :]


def _cut(content, random_, _):
    return content[: _place(content, random_)]


def _insert(content, random_, _):
    at, size = _place(content, random_), random_.choice((1, 2, 4, 7, 16, 100))
    return content[:at] + random_.choice((bytes(size), b"\xff" * size, random_.randbytes(size))) + content[at:]


def _delete(content, random_, _):
    start, end = _slice(content, random_)
    return content[:start] + content[end:]


def _double(content, random_, _):
    start, end = _slice(content, random_)
    return content[:end] + content[start:]


def _blank(content, random_, _):
    start, end = _slice(content, random_)
    return content[:start] + random_.choice((b"\0", b"\xff")) * (end - start) + content[end:]


def _move(content, random_, _):
    start, end = _slice(content, random_)
    rest, at = content[:start] + content[end:], _place(content, random_)
    return rest[:at] + content[start:end] + rest[at:]


def _splice(content, random_, other):
    return content[: _place(content, random_)] + other[_place(other, random_) :]


def _copy_over(content, random_, other):
    start, end = _slice(other, random_)
    at = _place(content, random_)
    return content[:at] + other[start:end] + content[at + end - start :]


def _another_word(content, random_, other):
    """A word of the file, of another file, or one that makes no sense there, in the place of a word."""
    found = list(WORD.finditer(content))
    if not found:
        return content
    word, others = random_.choice(found), WORD.findall(other) or [b""]
    new = random_.choice((random_.choice(WORDS), random_.choice(found)[0], random_.choice(others)))
    return content[: word.start()] + new + content[word.end() :]


def _another_number(content, random_, _):
    found = list(DIGITS.finditer(content))
    if not found:
        return content
    word = random_.choice(found)
    number = int(word[0][:18])
    new = random_.choice((random_.choice(NUMBERS), number + 1, number - 1, number * 10, random_.randrange(1000)))
    return content[: word.start()] + str(new).encode() + content[word.end() :]


def _another_digit(content, random_, _):
    found = list(DIGITS.finditer(content))
    if not found:
        return content
    at = random_.choice(found).start()
    return content[:at] + b"%d" % random_.randrange(10) + content[at + 1 :]


def _lines(content, random_, other):
    """Lines in another order, twice, many times, left out, or those of another file."""
    lines, others = content.splitlines(keepends=True), other.splitlines(keepends=True)
    if not lines or not others:
        return content
    at, to = random_.randrange(len(lines)), random_.randrange(len(lines))
    match random_.randrange(6):
        case 0:
            del lines[at]
        case 1:
            lines[at], lines[to] = lines[to], lines[at]
        case 2:
            lines.insert(to, lines[at])
        case 3:
            lines.insert(to, random_.choice(others))
        case 4:
            lines[at : at + 1] = [lines[at]] * random_.choice((2, 10, 300))
        case 5:
            lines[at] = lines[at].rstrip() + random_.choice((b"", b"\r\n", b"\n\n", b" \n", b"\t# \n"))
    return b"".join(lines)


def _another_array(content, random_, _):
    """In the place of a NumPy file one of another kind."""
    return random_.choice(ARRAYS) if content.startswith(b"\x93NUMPY") else content


def _ends_early(content, random_, _):
    """Without the last few bytes, as a copy that stopped has it."""
    return content[: len(content) - random_.randrange(1, 9)]


BYTE_CHANGES = (
    _flip,
    _set,
    _cut,
    _delete,
    _count,
    _count,
    _insert,
    _double,
    _blank,
    _move,
    _splice,
    _copy_over,
    _swap,
    _another_array,
)
TEXT_CHANGES = (_another_word, _another_number, _another_digit, _another_digit, _lines, _ends_early, _insert, _splice)
GENTLE_CHANGES = (_flip, _swap)
GENTLE_TEXT_CHANGES = (_another_digit, _ends_early, _lines)
