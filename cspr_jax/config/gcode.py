"""G-code: straight moves and arcs of a file, in SI units. Words that are not read are refused with their line."""

import math
import re
from pathlib import Path
from typing import NamedTuple

from cspr_jax.config.limits import LARGEST_LENGTH
from cspr_jax.config.reading import read_text
from cspr_jax.errors import ConfigError, shown

_WORD = re.compile(r"\s*([A-Za-z])\s*([+-]?(?:\d+\.?\d*|\.\d+))")
_NOTE = re.compile(r"\([^()]*\)|;.*")
# Numbers of G words by what they set; one of each may stand in a line.
_SETTINGS = {0: "motion", 1: "motion", 2: "motion", 3: "motion", 17: "plane"}
_SETTINGS |= {20: "units", 21: "units", 90: "distances", 91: "distances"}
_READ = "G0 G1 G2 G3 G17 G20 G21 G90 G91, X Y Z I J R, F, N, M2 M30"
_UNITS = {20: 0.0254, 21: 0.001}
MINUTE = 60.0  # s
# Moves that are not longer go nowhere, m.
SAME_PLACE = 1e-9
# By which rounded numbers may take the end of an arc off its circle, m.
ROUNDED = 1e-5


class Move(NamedTuple):
    """Move along a line, an arc or a helix, in the axes of the file.

    Fields:
        line: number in the file.
        start: [x, y, z], m.
        end: [x, y, z], m.
        centre: [x, y] of an arc, m; of a line None.
        angle: by which an arc turns about z, by the rule of the right hand, rad.
        speed: largest speed, m/s; inf without one.
    """

    line: int
    start: list[float]
    end: list[float]
    centre: list[float] | None = None
    angle: float = 0.0
    speed: float = math.inf


def read_moves(path: Path, start: list[float] | None = None) -> list[Move]:
    """Moves of a file of G-code. Lengths are in mm until it says otherwise, coordinates absolute.

    Args:
        start: [x, y, z] where it begins, m; None: where its first move ends.

    Returns:
        the moves; those that go nowhere are left out.

    Raises:
        ConfigError: a word that is not read, or that is missing, and its line.
    """
    reader = _GcodeReader(path, start)
    for number, text in enumerate(read_text(path).split("\n"), start=1):
        reader.line = number
        if reader.is_over(text):
            break
    if not reader.moves:
        raise ConfigError(path, "no move: must have two places at least, with G0, G1, G2 or G3")
    return reader.moves


class _GcodeReader:
    def __init__(self, path: Path, start: list[float] | None) -> None:
        self.path, self.place, self.moves = path, start, list[Move]()
        self.modes = {"motion": -1, "plane": 17, "units": 21, "distances": 90}
        self.speed, self.line = math.inf, 0

    def is_over(self, text: str) -> bool:
        # Take in a line; tell whether the program ends there.
        plain = _NOTE.sub(" ", text).strip()
        values: dict[str, float] = {}
        modes: dict[str, int] = {}
        ends, position = False, 0
        while position < len(plain) and plain != "%":
            word = _WORD.match(plain, position)
            if word is None:
                raise self._error(shown(plain[position:].strip()), f"must be words that are read: {_READ}")
            letter, value, position = word[1].upper(), float(word[2]), word.end()
            name = f"{letter}{word[2]}"
            kind = _SETTINGS.get(int(value)) if letter == "G" and value == int(value) else None
            if (letter == "G" and kind is None) or (letter == "M" and value not in (2, 30)):
                raise self._error(name, f"must be one of {_READ}")
            if letter not in "GXYZIJRFNM":
                raise self._error(name, f"must be one of {_READ}")
            if letter in values or (kind or "") in modes:
                raise self._error(name, "must stand once in a line" if kind is None else "must be one of its kind")
            if kind is not None:
                modes[kind] = int(value)
            elif letter == "M":
                ends = True
            else:
                values[letter] = value
        self.modes |= modes
        self._take(values)
        return ends

    def _error(self, word: str, allowed: str) -> ConfigError:
        return ConfigError(self.path, f"line {self.line}: {word}: {allowed}")

    def _take(self, values: dict[str, float]) -> None:
        unit, motion = _UNITS[self.modes["units"]], self.modes["motion"]
        if "F" in values:
            if values["F"] <= 0.0:
                raise self._error(f"F{values['F']:g}", "must be above 0")
            self.speed = values["F"] * unit / MINUTE
        lengths = {letter: unit * value for letter, value in values.items() if letter in "XYZIJR"}
        if not lengths:
            return
        for letter, length in lengths.items():
            if not abs(length) <= LARGEST_LENGTH:
                raise self._error(f"{letter}{values[letter]:g}", f"must be at most {LARGEST_LENGTH:g} m")
        if motion < 0:
            raise self._error(f"{next(iter(lengths))}", "must stand behind G0, G1, G2 or G3")
        words = {letter for letter in lengths if letter in "IJR"}
        if motion < 2 and words:
            raise self._error(min(words), "must be absent unless G2 or G3 is on")
        before, end = self.place, self._end(lengths)
        if before is None:
            if motion >= 2:
                raise self._error(f"G{motion}", "must follow a place: G0 or G1 first")
            self.place = end
        elif motion >= 2:
            self.moves.append(self._arc(before, end, lengths, motion))
            self.place = end
        elif math.dist(end, before) > SAME_PLACE:
            self.moves.append(Move(self.line, before, end, speed=self.speed if motion else math.inf))
            self.place = end

    def _end(self, lengths: dict[str, float]) -> list[float]:
        if self.place is None:
            missing = [letter for letter in "XYZ" if letter not in lengths]
            if missing or self.modes["distances"] == 91:
                fault = missing[0] if missing else "G91"
                raise self._error(fault, "must have X, Y and Z, absolute, in the first move: the path begins there")
            return [lengths[letter] for letter in "XYZ"]
        if self.modes["distances"] == 91:
            return [x + lengths.get(letter, 0.0) for letter, x in zip("XYZ", self.place, strict=True)]
        return [lengths.get(letter, x) for letter, x in zip("XYZ", self.place, strict=True)]

    def _arc(self, start: list[float], end: list[float], lengths: dict[str, float], motion: int) -> Move:
        sign = 1.0 if motion == 3 else -1.0
        across, up = end[0] - start[0], end[1] - start[1]
        chord = math.hypot(across, up)
        if ("R" in lengths) == ("I" in lengths or "J" in lengths):
            raise self._error(f"G{motion}", "must have I or J, from the start to the centre, or R: one of both")
        if "R" in lengths:
            radius = abs(lengths["R"])
            if chord == 0.0:
                raise self._error("R", "must be I or J where an arc ends above or at its start")
            if 0.5 * chord > radius + ROUNDED:
                raise self._error("R", f"must be at least half of the distance, {0.5 * chord:.6g} m")
            height = math.sqrt(max(radius**2 - 0.25 * chord**2, 0.0))
            # The centre of the shorter arc to the left is on the left; R below 0 is the longer arc.
            height *= sign if lengths["R"] > 0.0 else -sign
        else:
            i, j = lengths.get("I", 0.0), lengths.get("J", 0.0)
            radius, other = math.hypot(i, j), math.hypot(across - i, up - j)
            if radius == 0.0 or not abs(other - radius) <= ROUNDED:
                fault = f"radius {radius:.6g} m at the start, {other:.6g} m at the end"
                raise self._error(fault, f"must be above 0 and differ by at most {ROUNDED:g} m")
            if chord == 0.0:
                centre = [start[0] + i, start[1] + j]
                return Move(self.line, start, end, centre, sign * 2.0 * math.pi, self.speed)
            # The centre that is as far from the end as from the start: rounded numbers miss it.
            height = (across * j - up * i) / chord
        centre = [start[0] + 0.5 * across - height * up / chord, start[1] + 0.5 * up + height * across / chord]
        first = math.atan2(start[1] - centre[1], start[0] - centre[0])
        angle = math.atan2(end[1] - centre[1], end[0] - centre[0]) - first
        angle = sign * (sign * angle % (2.0 * math.pi)) or sign * 2.0 * math.pi
        return Move(self.line, start, end, centre, angle, self.speed)
