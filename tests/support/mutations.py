"""Ways in which a file is damaged, for the fuzzing: each takes a generator, the bytes, and other files' bytes."""

import contextlib
import re
import zipfile
from io import BytesIO

#: What to put in place of a number.
HOSTILE = (
    b"", b"-", b"nan", b"inf", b"1e400", b"-1e308", b"1.7976931348623157e308", b"0", b"-1", b"2147483648",
    b"999999999999999999999", b"1_000", b"0x10", b"1,5", b"1.5.2", "µ".encode("latin-1"), b"\0", b"1e-400",
)  # fmt: skip
#: Values of every kind, as text files write them.
KINDS = (
    b'""', b'"text"', b"7", b"-1", b"{}", b"1e999", b"null", b"true", b"[]", b"[[1, 2], [3]]", b'{"a": "b"}',
    b"NaN",    b'"1 m"', b'"1e-320 m"', b'"3 kPa"', b'[1, "a", null]',
)  # fmt: skip
BLOWN = (
    b"[" * 100_000, b'{"a":' * 20_000, b"a." * 20_000, b"1" * 5000, b"1" * 4000, b"x" * 140_000,
    b'"' + b"x" * 140_000 + b'"', b"," * 140_000, b"\n" * 20_000, b"(" * 9000, b"0." + b"0" * 2000 + b"1",
)  # fmt: skip
_TOKEN = re.compile(rb"[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?")
_VALUE = re.compile(rb'"[^"\n]{0,80}"|[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|\btrue\b|\bfalse\b|\bnull\b')


def mutate(rng, data, others):
    """One damaged copy of `data`."""
    if data[:2] == b"PK" and rng.random() < 0.7:
        with contextlib.suppress(Exception):  # a copy damaged before may no longer be an archive
            return mutate_members(rng, data, others)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        data = rng.choice(MUTATIONS)(rng, data, others)
    return data


def mutate_members(rng, data, others):
    """Damage one member, or the list of members, of an archive that stays one."""
    stream = BytesIO()
    with zipfile.ZipFile(BytesIO(data)) as archive, zipfile.ZipFile(stream, "w") as out:
        names = archive.namelist()
        chosen = rng.choice(names)
        for name in names:
            content = archive.read(name)
            if name == chosen:
                what = rng.random()
                if what < 0.1:
                    continue
                if what < 0.2:
                    name = rng.choice(("../../escape.txt", "/tmp/escape.txt", name * 2, "a" * 300))  # noqa: PLW2901, S108
                else:
                    content = mutate(rng, content, others) if content[:2] != b"PK" else content
            out.writestr(name, content)
    return stream.getvalue()


def flip(rng, data, _):
    if not data:
        return data
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 4, 32))):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def cut(rng, data, _):
    return data[: rng.randrange(len(data) + 1)]


def drop(rng, data, _):
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start + rng.randrange(1, 200) :]


def repeat(rng, data, _):
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start : start + rng.randrange(1, 400)] * rng.choice((2, 3, 50)) + data[start:]


def splice(rng, data, others):
    other = rng.choice(others)
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def number(rng, data, _):
    tokens = [match.span() for match in _TOKEN.finditer(data[:20_000])]
    if not tokens:
        return data
    start, end = rng.choice(tokens)
    return data[:start] + rng.choice(HOSTILE) + data[end:]


def lines(rng, data, _):
    parts = re.split(rb"(?<=\n)", data)
    i, j = rng.randrange(len(parts)), rng.randrange(len(parts))
    parts[i], parts[j] = parts[j], parts[i]
    if rng.random() < 0.3:
        del parts[i]
    return b"".join(parts)


def word(rng, data, _):
    """A large or negative number where a binary header may keep a size."""
    if len(data) < 16:
        return data
    start = rng.randrange(min(len(data) - 8, 4096))
    size = rng.choice((2, 4, 8))
    value = rng.choice(
        (b"\xff" * size, b"\x7f" + b"\xff" * (size - 1), b"\xff" * (size - 1) + b"\x7f", b"\0" * size)
    )
    return data[:start] + value + data[start + size :]


def encode(rng, data, _):
    return rng.choice(
        (
            b"\xef\xbb\xbf" + data,
            b"\xff\xfe" + data,
            data.replace(b"\r\n", b"\r"),
            data.replace(b"\t", b";"),
            data[::-1],
        )
    )


def blow(rng, data, _):
    """Something far too long or too deep where a value may stand."""
    start = rng.randrange(len(data) + 1)
    return data[:start] + rng.choice(BLOWN) + data[start:]


def swap(rng, data, _):
    """A value of another kind: text for a number, a list for a text, and so on."""
    values = [match.span() for match in _VALUE.finditer(data[:20_000])]
    if not values:
        return data
    start, end = rng.choice(values)
    return data[:start] + rng.choice(KINDS) + data[end:]


MUTATIONS = (
    flip, flip, cut, drop, repeat, splice, number, number, number, lines, word, encode, swap, swap, blow,
)  # fmt: skip
