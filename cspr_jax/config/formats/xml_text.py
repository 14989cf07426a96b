"""XML of somebody else: nothing is expanded or fetched; what is missing becomes one line."""

import math
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

from cspr_jax.config.reading import read_text
from cspr_jax.errors import ConfigError, shown


def read_xml(path: Path) -> Element:
    """Root of an XML file.

    Args:
        path: the file.

    Returns:
        the root. A DOCTYPE that names a file is passed over: that file is not read.

    Raises:
        ConfigError: the file cannot be read, is larger than 1 MB, is no XML, or declares entities.
    """
    from defusedxml import DefusedXmlException, ElementTree  # only who reads XML waits for it

    text = read_text(path)
    try:
        return ElementTree.fromstring(text.encode("utf-8"))
    except DefusedXmlException as error:
        raise ConfigError(path, "declares XML entities: must be without, these are not expanded") from error
    except (ParseError, ValueError, LookupError, RecursionError) as error:
        raise ConfigError(path, f"is not XML: {error}") from error


def child(parent: Element, tag: str, file: object, place: str = "") -> Element:
    """The one element of a kind below another.

    Args:
        parent: the other.
        tag: of the kind, directly below it.
        file: named in errors.
        place: what the parent is, for errors.

    Returns:
        the element.

    Raises:
        ConfigError: none, or several.
    """
    found = parent.findall(tag)
    if len(found) != 1:
        raise ConfigError(file, f"{place or parent.tag}: {len(found)} elements <{tag}>: must be one")
    return found[0]


def text_of(element: Element) -> str:
    """Text of an element.

    Args:
        element: the element.

    Returns:
        its text without spaces around it.
    """
    return (element.text or "").strip()


def number(text: str, file: object, place: str, *, infinite: bool = False) -> float:
    """A number.

    Args:
        text: that says it.
        file: named in errors.
        place: where it stands, for errors.
        infinite: whether it may be infinite.

    Returns:
        the number.

    Raises:
        ConfigError: no number, or none that is finite.
    """
    try:
        value = float(text[:100])
    except ValueError:
        value = math.nan
    if math.isnan(value) or (math.isinf(value) and not (infinite and value > 0.0)):
        raise ConfigError(file, f"{place} = {shown(text)}: must be a finite number")
    return value


def vector(element: Element, file: object, place: str) -> list[float]:
    """A point or a direction.

    Args:
        element: whose text holds it.
        file: named in errors.
        place: where it stands, for errors.

    Returns:
        (3,).

    Raises:
        ConfigError: not three finite numbers.
    """
    words = text_of(element).split()
    if len(words) != 3:
        raise ConfigError(file, f"{place}.{element.tag} = {shown(text_of(element))}: must be three numbers")
    return [number(word, file, f"{place}.{element.tag}") for word in words]
