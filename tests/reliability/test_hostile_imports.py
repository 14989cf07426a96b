"""Mutated robot files of other programs: each is read, or refused in one line; none ends in a traceback or hangs."""

import json
import re
import warnings

import config.test_formats as samples
import numpy as np
import pytest

from cspr_jax.config.hints import robot_hints
from cspr_jax.config.robot import read_foreign
from cspr_jax.errors import ConfigError, ExitCode

TOKENS = (
    *("", "0", "-1", "1e400", "-1e308", "1e-320", "nan", "inf", "9" * 400, "0x1F", "1:1:1.5", "\u2212", "\u00a0", "\0"),
    *('"', "'", "<", ">", "/>", "</", "<!--", "-->", "<![CDATA[", "]]>", "<?x?>", "&lt;", "&#0;", "&#x110000;", "&a;"),
    *("[", "]", "{", "}", "{}", "[]", ":", ",", "- ", "\n", "\t", "*a", "&a ", "<<: *a", "!!int ", "!!binary ", "? "),
    *(
        "null",
        "true",
        "~",
        "<!DOCTYPE x [<!ENTITY a 'b'>]>",
        "<x/>",
        '<?xml version="1.0" encoding="utf-7"?>',
        "\ufeff",
    ),
)
NUMBERS = (
    "0",
    "-1",
    "1e9",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "-.inf",
    ".5",
    "1_0",
    "7",
    "0.25",
    "1e155",
    "9" * 30,
)
BYTES = (b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf", b"\xff", b"\xc0\x80", b"\xed\xa0\x80", b"\0")


def mutated(text, rng):
    """A text with one to three edits: numbers, or pieces; now and then in bytes or in another encoding."""
    for _ in range(rng.integers(1, 4)):
        start = int(rng.integers(len(text) + 1))
        number = re.compile(r"-?\d[\d.]*").search(text, start) if rng.random() < 0.7 else None
        if number is not None:
            text = text[: number.start()] + NUMBERS[rng.integers(len(NUMBERS))] + text[number.end() :]
            continue
        end = start + int(rng.integers(12) if rng.random() < 0.8 else rng.integers(400))
        piece, token = text[start:end], TOKENS[rng.integers(len(TOKENS))]
        text = text[:start] + (token, piece * 2, piece[::-1], token + piece)[rng.integers(4)] + text[end:]
    choice = rng.random()
    if choice < 0.05:
        return text.encode(("utf-16", "utf-16-le", "utf-32", "latin-1")[rng.integers(4)], "replace")
    data = bytearray(text.encode("utf-8"))
    if choice < 0.15 and data:
        data[rng.integers(len(data))] = rng.integers(256)
    elif choice < 0.2:
        start = rng.integers(len(data) + 1)
        data[start:start] = BYTES[rng.integers(len(BYTES))]
    return bytes(data)


def seeds(folder):
    """A file of each format, as a path to mutate, and a path to read."""
    cables = samples.caspr(folder, samples.plain_cables()[:-1] + ">")
    yaml = samples.written(folder, "yaml")
    (folder / "robot.json").write_text(json.dumps(samples.CDPYR, indent=1))
    wirex = samples.loaded(folder, 'min_cable_load="40" max_cable_load="1000"')
    bodies = folder / "hub_bodies.xml"
    return [(path, path) for path in (yaml, folder / "robot.json", wirex, cables)] + [(bodies, cables)]


def outcomes(folder, count):
    """How many of some mutations of each file are read, and how many refused."""
    rng, read, refused = np.random.default_rng(44), 0, 0
    for path, entry in seeds(folder):
        text = path.read_text()
        for _ in range(count):
            path.write_bytes(mutated(text, rng))
            try:
                robot_hints(read_foreign(entry)[0])
                read += 1
            except ConfigError as error:
                refused += 1
                line = str(error)
                assert len(line.splitlines()) == 1 and line.isprintable() and len(line) < 1500, line
                assert str(folder) in line and error.exit_code == ExitCode.BAD_INPUT, line
        path.write_text(text)
    return read, refused


def test_mutated_robot_files(tmp_path):
    """NumPy's warnings count as failures: they would be further lines."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read, refused = outcomes(tmp_path, 120)
    assert read > 50 and refused > 200


@pytest.mark.soak
def test_mutated_robot_files_all(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read, refused = outcomes(tmp_path, 20_000)
    assert read > 10_000 and refused > 40_000
