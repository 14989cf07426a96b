"""Keys that a user probably meant by one that does not exist: by its words first, then by its letters."""

import difflib
import functools
import inspect
import re
import unicodedata
from collections.abc import Collection, Iterable
from typing import Any, TypeVar

from cspr_jax.errors import demand

Kind = TypeVar("Kind", bound=type)

# Words that users write, with the words of the keys that they mean.
_SYNONYMS = {
    "maximum": "max",
    "largest": "max",
    "upper": "max",
    "minimum": "min",
    "smallest": "min",
    "lower": "min",
    "begin": "from",
    "start": "from",
    "initial": "from",
    "velocity": "speed",
    "force": "tension",
    "wire": "cable",
    "rope": "cable",
    "target": "position",
    "ground": "floor",
    "center": "centre",
    "weight": "mass",
    "anchors": "base",
    "spools": "base",
    "oscillations": "arcs",
}
# A height names the floor only where it cannot be a depth of P0 or a coordinate of targets.
_HEIGHT = frozenset({"z0", "z"})
ALIKE = 0.8  # smallest similarity, as `difflib` has it, of a word and its misspelling
ENOUGH = 0.5  # keys are similar if they have more than this fraction of their words in common
LETTERS = 0.6
LONGEST = 100  # letters; longer texts are not compared
# Characters that word processors and web pages put in place of plain ones.
_LOOK_ALIKES = {
    '"': "\u201c\u201d\u201e\u201f\u2033\u00ab\u00bb\uff02",
    "'": "\u2018\u2019\u201a\u201b\u2032\u2039\u203a\u00b4\uff07",
    "-": "\u2212\u2010\u2011\u2012\u2013\u2014\u2015\ufe63\uff0d",
    "a plain space": "\u00a0\u2002\u2003\u2007\u2008\u2009\u200a\u202f\u205f\u3000",
    "": "\u200b\u200c\u200d\u200e\u200f\u2060\ufeff\u00ad",  # invisible characters
    "=": "\uff1d",
    ",": "\uff0c",
    ".": "\uff0e",
}
_PLAIN = {character: plain for plain, characters in _LOOK_ALIKES.items() for character in characters}


def nearest(text: str, allowed: Iterable[str]) -> str | None:
    """The allowed name that a user probably meant."""
    names = list(allowed)
    if len(text) > LONGEST:
        return None
    words = _words(text)
    if "height" in words and _HEIGHT.isdisjoint(names):
        words = [word.replace("height", "floor") for word in words]
    if words:
        # Among equals, prefer the name with the most similar letters.
        ranked = [(_common_fraction(words, _words(name)), _letters(text, name), name) for name in names]
        best = max(ranked, default=(0.0, 0.0, ""))
        if best[0] > ENOUGH:
            return best[2]
    near = difflib.get_close_matches(text.lower(), names, n=1, cutoff=LETTERS)
    return near[0] if near else None


def look_alike(text: str) -> str:
    """Clause of a message that names a character in a text that only looks like a plain one."""
    character = next((character for character in text if character in _PLAIN), "")
    if not character:
        return ""
    name, plain = f"U+{ord(character):04X}, {unicodedata.name(character, 'unnamed').lower()}", _PLAIN[character]
    return f": did you mean {plain} in place of {name}?" if plain else f": it holds {name}, which cannot be seen"


def did_you_mean(text: str, allowed: Iterable[str]) -> str:
    """The question of an error message whether a similar name was meant."""
    near = nearest(text, allowed)
    return f"did you mean {near}? " if near else ""


def one_of(value: object, names: Iterable[str], allowed: str = "") -> str:
    """Names that an error message offers: the one that was probably meant, then all of them."""
    names = list(names)
    allowed = allowed or f"one of {', '.join(names)}"
    question = did_you_mean(value, names) if isinstance(value, str) else ""
    return f"{question}{demand(allowed)}" if question else allowed


def ask_about_keywords(function: str, keywords: Iterable[str], accepted: Collection[str]) -> None:
    """Raise a `TypeError` where a keyword that a function does not take is nearly one that it takes."""
    for key in (key for key in keywords if key not in accepted):
        question = did_you_mean(key, accepted)
        if question:
            raise TypeError(f"{function}() takes no {key}: {question.strip()}") from None


def with_suggestions(kind: Kind) -> Kind:
    """Make a class ask about keywords that are nearly those of its constructor."""
    plain = kind.__init__  # type: ignore[misc]
    accepted = tuple(inspect.signature(kind).parameters)

    @functools.wraps(plain)
    def with_question(self: Any, *arguments: Any, **keywords: Any) -> None:
        ask_about_keywords(kind.__name__, keywords, accepted)
        plain(self, *arguments, **keywords)

    kind.__init__ = with_question  # type: ignore[misc]
    return kind


def _words(name: str) -> list[str]:
    # max_tension, max-tension, max.tension and maxTension are the same words.
    parts = re.findall(r"[A-Z]?[a-z]+|[A-Z]+|\d+", name)
    return [_SYNONYMS.get(part.lower(), part.lower()) for part in parts]


def _letters(first: str, second: str) -> float:
    return difflib.SequenceMatcher(None, first, second).ratio()


def _common_fraction(first: list[str], second: list[str]) -> float:
    # Return the number of common words over the number of all words of both.
    left, count = list(second), 0
    for word in first:
        near = difflib.get_close_matches(word, left, n=1, cutoff=ALIKE)
        if near:
            left.remove(near[0])
            count += 1
    return count / max(len(first) + len(left), 1)
