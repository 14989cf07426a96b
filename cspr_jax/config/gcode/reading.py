"""G-code: straight moves and arcs of a file, in SI units. Words that change the path otherwise are refused."""

import math
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from cspr_jax.config.gcode import words as gcode_words
from cspr_jax.config.gcode.arcs import SAME_PLACE, ArcError, arc_about, arc_of_radius
from cspr_jax.config.gcode.words import LENGTHS, SETTINGS, GcodeLine, Word, WordError, line_of
from cspr_jax.config.keys.limits import LARGEST_LENGTH
from cspr_jax.config.reading import read_text
from cspr_jax.errors import ConfigError
from cspr_jax.errors.given_numbers import LARGEST, SMALLEST

_UNITS = {20: 0.0254, 21: 0.001}
_DECIMALS = re.compile(r"[XYZIJKR]\s*[+-]?\d*\.(\d+)", re.IGNORECASE)
# For each plane: index of the normal axis, and letters of positions and of centres in the order of positive turns.
_PLANES = {17: (2, "XY", "IJ"), 18: (1, "ZX", "KI"), 19: (0, "YZ", "JK")}
MINUTE = 60.0  # s
# Largest number of words that a message names, and of decimals that count.
MAX_NAMED, MAX_DECIMALS = 12, 12


class Move(NamedTuple):
    """Move along a line, an arc or a helix, in the axes of the file.

    Fields:
        line: number of its line in the file.
        start: [x, y, z], m.
        end: [x, y, z], m.
        centre: of an arc in its plane, [x, y], of G18 [z, x], of G19 [y, z], m; of a line None.
        angle: by which an arc turns about its normal, by the rule of the right hand, rad.
        speed: largest speed, m/s; inf without one.
        feed: speed as the file has it, such as "F600"; "" without one.
        normal: index of the axis about which an arc turns.
        ends_at_rest: whether the program pauses after it.
    """

    line: int
    start: list[float]
    end: list[float]
    centre: list[float] | None = None
    angle: float = 0.0
    speed: float = math.inf
    feed: str = ""
    normal: int = 2
    ends_at_rest: bool = False


class GcodeProgram(NamedTuple):
    """Moves of a program.

    Fields:
        moves: moves that change the position, from the point on where x, y and z are all known.
        notes: what its user should know, in lines.
    """

    moves: list[Move]
    notes: list[str]


def read_program(path: Path, start: list[float] | None = None) -> GcodeProgram:
    """Moves of a file of G-code; until it says otherwise, lengths are in mm and coordinates absolute."""
    text = read_text(path)
    reader = _GcodeReader(path, start, _decimals(text))
    for number, line in enumerate(text.split("\n"), start=1):
        reader.line = number
        if reader.is_over(line):
            break
    reader.check()
    return GcodeProgram(reader.moves, reader.notes())


def _decimals(text: str) -> int:
    # Files may leave out trailing zeros: all lengths are as precise as the one with most decimals.
    return min(max(map(len, _DECIMALS.findall(text)), default=0), MAX_DECIMALS)


class _GcodeReader:
    def __init__(self, path: Path, start: list[float] | None, decimals: int) -> None:
        self.path, self.moves, self.line = path, list[Move](), 0
        # `position` is as written, `end` where the last move ends: arcs may end beside the written position.
        self.position: list[float | None] = [None] * 3 if start is None else [*start]
        self.end, self.shift, self.half_unit = start, [0.0] * 3, 0.5 * 0.1**decimals
        self.modes = {"motion": -1.0, "plane": 17.0, "units": 21.0, "distances": 90.0, "centres": 91.1}
        self.speed, self.feed, self.override = math.inf, "", 1.0
        self.system, self.first, self.away, self.waits = 0.0, 0, "", False
        self.skipped, self.paused = Counter[str](), list[int]()

    @property
    def unit(self) -> float:
        return _UNITS[int(self.modes["units"])]

    def is_over(self, text: str) -> bool:
        # Read a line; tell whether the program ends there.
        if text.strip() == "%":
            return bool(self.moves)
        try:
            line = line_of(text)
            self._follow(line)
        except (WordError, ArcError) as error:
            word, allowed = error.args
            raise ConfigError(self.path, f"line {self.line}: {word}: {allowed}") from error
        ends = any(word.value in gcode_words.ENDS for word in line.others)
        self.skipped.update(line.skipped)
        self.skipped.update(word.text for word in line.others if word.value not in gcode_words.ENDS)
        return ends

    def check(self) -> None:
        unknown = [letter for letter, x in zip("XYZ", self.position, strict=True) if x is None]
        if not self.moves and unknown:
            names = " and ".join(unknown)
            allowed = "must be given, absolute: the path begins where X, Y and Z are known"
            raise ConfigError(self.path, f"no move: {names}: {allowed}")
        if not self.moves:
            raise ConfigError(self.path, "no move: must have two places at least, with G0, G1, G2 or G3")

    def notes(self) -> list[str]:
        lines = []
        if self.skipped:
            names = [
                name if count == 1 else f"{name} ({count:,} times)"
                for name, count in self.skipped.most_common(MAX_NAMED)
            ]
            names += [f"{len(self.skipped) - MAX_NAMED} others"] if len(self.skipped) > MAX_NAMED else []
            total = sum(self.skipped.values())
            lines.append(f"{self.path.name}: {total:,} words that change no path are skipped: {', '.join(names)}")
        if self.paused:
            more = f" and {len(self.paused) - 1} more" if len(self.paused) > 1 else ""
            lines.append(
                f"{self.path.name}: line {self.paused[0]}{more}: the motion stops for a pause, and does not wait there"
            )
        if self.first and self.waits:
            lines.append(f"{self.path.name}: the path begins in line {self.first}, where X, Y and Z are known")
        if self.away:
            lines.append(f"{self.path.name}: the path ends before {self.away}, whose place is not in the file")
        return lines

    def _follow(self, line: GcodeLine) -> None:
        # Apply a line in the order in which controllers do: feed, units, pauses, then moves.
        codes = [code.value for code in line.codes]
        self.modes |= {SETTINGS[code]: code for code in codes if code in SETTINGS}
        self._set_feed(line)
        self._keep_system(line)
        axes = {letter: word for letter, word in line.values.items() if letter in LENGTHS}
        home = next((gcode_words.HOME[code] for code in codes if code in gcode_words.HOME), None)
        if gcode_words.SHIFT in codes:
            self._shift(axes)
        elif home is not None:
            self._go_home(home, axes)
        elif gcode_words.DWELL in codes:
            line.skipped.clear()
            self._pause()
        elif any(code in gcode_words.END_SHIFT for code in codes):
            self.shift = [0.0] * 3
        elif axes:
            self._move(axes, line)
        if any(word.value in gcode_words.PAUSES for word in line.others):
            self._pause()

    def _set_feed(self, line: GcodeLine) -> None:
        word, scale = line.values.get("F"), line.values.get("S")
        if any(other.value == gcode_words.OVERRIDE for other in line.others) and scale is not None:
            if not 0.0 < (scale.value or 0.0) <= 999.0:
                raise WordError(f"M220 {scale.text}", "must be above 0, at most 999 %")
            self.speed *= 0.01 * (scale.value or 0.0) / self.override
            self.override = 0.01 * (scale.value or 0.0)
        if word is not None:
            speed = (word.value or 0.0) * self.unit / MINUTE * self.override
            if not SMALLEST <= speed <= LARGEST:
                raise WordError(word.text, f"must be a speed from {SMALLEST:g} to {LARGEST:g} m/s")
            self.speed, self.feed = speed, word.text

    def _keep_system(self, line: GcodeLine) -> None:
        for code in line.codes:
            if code.value in gcode_words.SYSTEMS:
                if self.system not in (0.0, code.value):
                    raise WordError(code.text, "must be one system of coordinates: their offsets are not in the file")
                self.system = code.value or 0.0
                self.skipped[code.text] += 1

    def _lengths(self, axes: dict[str, Word]) -> dict[str, float]:
        lengths = {letter: self.unit * (word.value or 0.0) for letter, word in axes.items()}
        for letter, length in lengths.items():
            if not abs(length) <= LARGEST_LENGTH:
                raise WordError(axes[letter].text, f"must be at most {LARGEST_LENGTH:g} m")
        return lengths

    def _shift(self, axes: dict[str, Word]) -> None:
        # G92 gives the current position these coordinates from here on, also where it was unknown.
        for letter, length in self._lengths(axes).items():
            i = "XYZ".find(letter)
            if i >= 0:
                before = self.position[i]
                self.position[i] = length if before is None else before
                self.shift[i] = 0.0 if before is None else length - before
        self._begin()

    def _go_home(self, name: str, axes: dict[str, Word]) -> None:
        # Only the machine knows the home position: the path begins after such a move, or ends before it.
        self.skipped[name] += 1
        if self.moves:
            self.away = self.away or f"line {self.line}, {name}"
            return
        named = [i for i, letter in enumerate("XYZ") if letter in axes] or range(3)
        for i in named:
            self.position[i], self.shift[i], self.end = None, 0.0, None

    def _pause(self) -> None:
        if self.moves:
            self.moves[-1] = self.moves[-1]._replace(ends_at_rest=True)
            self.paused.append(self.line)

    def _move(self, axes: dict[str, Word], line: GcodeLine) -> None:
        motion, lengths = self.modes["motion"], self._lengths(axes)
        if self.away:
            raise WordError(
                next(iter(axes.values())).text, f"must be absent behind {self.away}: write where that leads"
            )
        if motion < 0.0:
            raise WordError(next(iter(axes)), "must stand behind G0, G1, G2 or G3")
        words = {letter for letter in lengths if letter in "IJKR"}
        if motion < 2.0 and words:
            raise WordError(min(words), "must be absent unless G2 or G3 is on")
        for i, letter in enumerate("XYZ"):
            self._set_axis(i, lengths.get(letter))
        if self.end is None:
            if motion >= 2.0:
                raise WordError(f"G{motion:g}", "must follow a place: G0 or G1 first")
            self._begin()
            self.waits |= self.end is None
        elif motion >= 2.0:
            if line.values.get("P") is not None:
                raise WordError(line.values["P"].text, "must be absent of arcs: write each turn as an arc")
            self._add_arc(lengths, 1.0 if motion == 3.0 else -1.0)
        else:
            end = [float(x or 0.0) for x in self.position]
            if math.dist(end, self.end) > SAME_PLACE:
                speed, feed = (self.speed, self._feed) if motion else (math.inf, "")
                self.moves.append(Move(self.line, self.end, end, speed=speed, feed=feed))
                self.end = end

    @property
    def _feed(self) -> str:
        return self.feed if self.override == 1.0 or not self.feed else f"{self.feed} at {100.0 * self.override:g} %"

    def _set_axis(self, i: int, length: float | None) -> None:
        before = self.position[i]
        if length is None:
            return
        if self.modes["distances"] == 91.0:
            self.position[i] = None if before is None else before + length
        else:
            self.position[i] = length - self.shift[i]

    def _begin(self) -> None:
        # The path begins at the first position whose coordinates are all known.
        if self.end is None and None not in self.position:
            self.end, self.first = [float(x or 0.0) for x in self.position], self.line

    def _add_arc(self, lengths: dict[str, float], sign: float) -> None:
        normal, letters, offsets = _PLANES[int(self.modes["plane"])]
        ones = ["XYZ".index(letter) for letter in letters]
        position, before = [float(x or 0.0) for x in self.position], list(self.end or [])
        start, end = [before[i] for i in ones], [position[i] for i in ones]
        others = [letter for letter in "IJK" if letter in lengths and letter not in offsets]
        centred = [letter for letter in offsets if letter in lengths]
        if others:
            raise WordError(others[0], f"must be {offsets[0]} or {offsets[1]} in this plane")
        if ("R" in lengths) == bool(centred):
            raise WordError("G3" if sign > 0.0 else "G2", self._arc_words(offsets))
        half = self.half_unit * self.unit
        if "R" in lengths:
            arc = arc_of_radius(start, end, lengths["R"], sign, half)
        else:
            arc = arc_about(start, end, self._centre(start, ones, offsets, lengths), sign, half)
        for i, x in zip(ones, arc.end, strict=True):
            position[i] = x
        self.moves.append(Move(self.line, before, position, arc.centre, arc.angle, self.speed, self._feed, normal))
        self.end = position

    @staticmethod
    def _arc_words(offsets: str) -> str:
        return f"must have {offsets[0]} or {offsets[1]}, from the start to the centre, or R: one of both"

    def _centre(self, start: list[float], ones: list[int], offsets: str, lengths: dict[str, float]) -> list[float]:
        if self.modes["centres"] == 91.1:
            return [x + lengths.get(letter, 0.0) for x, letter in zip(start, offsets, strict=True)]
        missing = [letter for letter in offsets if letter not in lengths]
        if missing:
            raise WordError(missing[0], "must be given where G90.1 makes centres absolute")
        return [lengths[letter] - self.shift[i] for letter, i in zip(offsets, ones, strict=True)]
