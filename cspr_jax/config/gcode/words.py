"""Words of G-code by their effect on a path, as LinuxCNC, Grbl and Marlin read them."""

import re
from typing import NamedTuple

from cspr_jax.errors import shown

_WORD = re.compile(r"\s*([A-Za-z])\s*([+-]?(?:\d+\.?\d*|\.\d+))?")
_COMMENT = re.compile(r"\([^()]*\)|;.*")
# Checksum of a line that a host sends to a printer; a number with an exponent.
_CHECKSUM = re.compile(r"\*\s*\d+\s*$")
_EXPONENT = re.compile(r"e[+-]?\d|E[+-]\d\d")
# Numbers of G words, with what they set; a line may set each of these once.
SETTINGS = {0.0: "motion", 1.0: "motion", 2.0: "motion", 3.0: "motion", 17.0: "plane", 18.0: "plane", 19.0: "plane"}
SETTINGS |= {20.0: "units", 21.0: "units", 90.0: "distances", 91.0: "distances", 90.1: "centres", 91.1: "centres"}
# G words of coordinate systems, whose offsets only the machine knows.
SYSTEMS = {float(code) for code in range(54, 60)} | {59.1, 59.2, 59.3}
# G words that move to positions that the machine knows, and the file does not.
HOME = {28.0: "G28", 29.0: "G29", 30.0: "G30", 53.0: "G53"}
DWELL = 4.0
SHIFT = 92.0
END_SHIFT = (92.1, 92.2)
# G words without effect on a path: compensations and modes off, tool lengths, path modes, returns of canned cycles.
_SKIPPED = {8.0, 9.0, 10.0, 11.0, 15.0, 28.1, 30.1, 40.0, 43.0, 43.1, 43.4, 49.0, 50.0, 61.0, 61.1, 64.0, 69.0, 80.0}
_SKIPPED |= {94.0, 96.0, 97.0, 98.0, 99.0}
_CURVE, _CYCLE = "must be written as G1, G2 and G3", "must be written as the G0 and G1 that it stands for"
# Other G words that change a path, with what to write instead.
_REFUSED = {5.0: _CURVE, 5.1: _CURVE, 5.2: _CURVE, 5.3: _CURVE}
_REFUSED |= dict.fromkeys((33.0, 33.1, 38.2, 38.3, 38.4, 38.5, 73.0, 74.0, 76.0), _CYCLE)
_REFUSED |= dict.fromkeys((float(code) for code in range(81, 90)), _CYCLE)
_REFUSED |= dict.fromkeys((41.0, 41.1, 42.0, 42.1), "must be left out: write the path of the tool's centre")
_REFUSED |= dict.fromkeys((16.0, 51.0, 52.0, 68.0, 92.3), "must be left out: write the coordinates that it leads to")
_REFUSED |= {93.0: "must be G94: F in units a minute", 95.0: "must be G94: F in units a minute"}
READ = (
    "G0 G1 G2 G3 G4 G17 G18 G19 G20 G21 G28 G54 G90 G91 G90.1 G91.1 G92, X Y Z I J K R, F, N, M2 M30, or words that "
    "change no path"
)
ENDS, PAUSES = (2.0, 30.0), (0.0, 1.0, 6.0, 60.0)
OVERRIDE = 220.0
# M words of NIST's standard: axes may move in the same line. Other M words take parameters of their own, or a text.
_STANDARD = {float(code) for code in (*range(12), 30, *range(48, 54), *range(60, 74))}
_ELSEWHERE = {47.0, 97.0, 98.0, 99.0, 206.0, 428.0}
# Letters of extruders, spindles and tools, which change no path.
_LETTERS = "DEHLPQST"
_TURNS = "ABCUVW"
LENGTHS = "XYZIJKR"
# Largest number of digits of a number that a message shows.
_DIGITS = 24


class Word(NamedTuple):
    """Letter and number.

    Fields:
        letter: a capital.
        value: the number; None: there is none.
        text: both, as a message shows them.
    """

    letter: str
    value: float | None
    text: str


class GcodeLine(NamedTuple):
    """Line of a program.

    Fields:
        codes: its G words, in order.
        others: its M words likewise.
        values: its other words by their letters.
        skipped: names of words that change no path.
    """

    codes: list[Word]
    others: list[Word]
    values: dict[str, Word]
    skipped: list[str]


class WordError(ValueError):
    """A word that is not read; arguments are its text and what is allowed."""


def line_of(text: str) -> GcodeLine:
    """Words of a line."""
    plain = _CHECKSUM.sub("", _COMMENT.sub(" ", text).strip()).strip()
    line = GcodeLine([], [], {}, [])
    if not plain or plain == "%":
        return line
    if plain[0] == "$" or re.fullmatch(r"[Oo:]\s*\d+", plain):
        line.skipped.append(plain[:2] if plain[0] == "$" else plain[0].upper())
        return line
    if plain[0] == "/":
        raise WordError(shown(plain), "must be kept or left out: whether a controller skips it is not known here")
    position = 0
    while position < len(plain):
        match = _WORD.match(plain, position)
        if match is None:
            raise WordError(shown(plain[position:].strip()), f"must be words that are read: {READ}")
        word, position = _word(match), match.end()
        if word.value is not None and _EXPONENT.match(plain, position):
            raise WordError(shown(plain[match.start() :].strip()), "must be numbers without an exponent")
        if _take(line, word, plain[match.start() :]):
            break
    return line


def _word(match: re.Match[str]) -> Word:
    digits = match[2] or ""
    shortened = f"{digits[:_DIGITS]}..." if len(digits) > _DIGITS else digits
    return Word(match[1].upper(), float(digits) if digits else None, f"{match[1].upper()}{shortened}")


def _take(line: GcodeLine, word: Word, rest: str) -> bool:
    # Read a word; tell whether the rest of the line belongs to it.
    letter, value, name = word
    is_home = any(code.value in (28.0, 29.0, 30.0) for code in line.codes)
    if value is None and (letter in "GMNF" or not (is_home or letter in "DEHLPQSTW")):
        raise WordError(shown(rest.strip()), f"must be words that are read: {READ}")
    if letter == "G":
        return _take_code(line, word, rest)
    if letter == "M":
        return _take_other(line, word)
    if letter in _TURNS and not is_home:
        raise WordError(name, "must be left out: the orientation stays along G-code, and other axes are not moved")
    if letter == "N":
        return False
    if letter in _LETTERS or letter in _TURNS:
        line.skipped.append(letter)
        if letter in "PS":
            line.values[letter] = word
        return False
    if letter not in LENGTHS + "F":
        raise WordError(name, f"must be one of {READ}")
    if letter in line.values:
        raise WordError(name, "must stand once in a line")
    line.values[letter] = word
    return False


def _take_code(line: GcodeLine, word: Word, rest: str) -> bool:
    value = word.value
    if value in _REFUSED:
        raise WordError(word.text, _REFUSED[value])
    kind = SETTINGS.get(value) if value is not None else None
    if kind is not None and any(SETTINGS.get(code.value or 0.0) == kind for code in line.codes):
        raise WordError(word.text, "must be one of its kind")
    if value in _SKIPPED:
        if value == 10.0 and "L" in rest.upper():
            raise WordError(word.text, "must be left out: write the coordinates that it leads to")
        line.skipped.append(word.text)
        return value in (10.0, 11.0, 28.1, 30.1)
    is_read = kind is not None or value in SYSTEMS or value in HOME or value in (DWELL, SHIFT, *END_SHIFT)
    if not is_read:
        raise WordError(word.text, f"must be one of {READ}")
    line.codes.append(word)
    return False


def _take_other(line: GcodeLine, word: Word) -> bool:
    if word.value in _ELSEWHERE:
        raise WordError(word.text, "must be left out: write out the moves, in the coordinates that it leads to")
    line.others.append(word)
    return word.value not in _STANDARD and word.value != OVERRIDE
