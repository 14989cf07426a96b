"""XML of other programs: nothing is expanded or fetched; a missing element becomes an error of one line."""

import codecs
import math
import re
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

from cspr_jax.config.formats.model import LARGEST_NUMBER
from cspr_jax.config.reading import decoded, look_alike_before, read_bytes
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import look_alike

LONGEST_FAULT = 200  # characters of a parser's message
_DECLARED = re.compile(rb"""<\?xml[^>]*?\sencoding\s*=\s*["']([^"']{1,40})""")
_UTF16 = {
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
    b"<\0": "UTF-16LE",
    b"\0<": "UTF-16BE",
}


def read_xml(path: Path) -> Element:
    """Root of an XML file."""
    from defusedxml import DefusedXmlException, ElementTree  # imported only where XML is read, since it takes time

    data = read_bytes(path)
    encoding, name = _encoding(data)
    text = decoded(data, path) if encoding == "UTF-8" else ""
    parser = ElementTree.DefusedXMLParser(encoding=encoding)
    try:
        parser.feed(text.encode("utf-8") if encoding == "UTF-8" else data)
        return parser.close()
    except DefusedXmlException as error:
        raise ConfigError(path, "declares XML entities: must be without, these are not expanded") from error
    except ParseError as error:
        line, column = error.position
        end = sum(len(row) + 1 for row in text.split("\n")[: line - 1]) + column
        hint = look_alike_before(text, end)
        raise ConfigError(path, f"is not XML: {error}"[:LONGEST_FAULT] + hint) from error
    except RecursionError as error:
        raise ConfigError(path, "is not XML that is read here: nested too deeply") from error
    except (ValueError, LookupError) as error:  # raised by codecs
        allowed = "UTF-8, UTF-16, or one with a byte for each character, such as ISO-8859-1"
        raise ConfigError(path, f"encoding = {shown(name)}: must be {allowed}") from error


def _encoding(data: bytes) -> tuple[str | None, str]:
    # Encoding by the first bytes, which take precedence over the declaration; None: the parser reads the declaration.
    if data[:2] in _UTF16:
        return _UTF16[data[:2]], ""
    declared = _DECLARED.match(data)
    name = declared[1].decode("latin-1") if declared else "UTF-8"
    is_utf8 = data.startswith(codecs.BOM_UTF8) or name.upper() in ("UTF-8", "UTF8")
    return ("UTF-8" if is_utf8 else None), name


def child(parent: Element, tag: str, file: object, label: str = "") -> Element:
    """The only child element of a tag."""
    elements = parent.findall(tag)
    if len(elements) != 1:
        raise ConfigError(file, f"{label or parent.tag}: {len(elements)} elements <{tag}>: must be one")
    return elements[0]


def text_of(element: Element) -> str:
    """Text of an element."""
    return (element.text or "").strip()


def number(text: str, file: object, label: str, *, infinite: bool = False) -> float:
    """A number."""
    try:
        value = float(text[:100])
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST_NUMBER and not (infinite and value > 0.0):
        bound = f" up to {LARGEST_NUMBER:g}" * math.isfinite(value)
        raise ConfigError(file, f"{label} = {shown(text)}: must be a finite number{bound}{look_alike(text[:100])}")
    return value


def vector(element: Element, file: object, label: str) -> list[float]:
    """A point or a direction."""
    words = text_of(element).split()
    if len(words) != 3:
        raise ConfigError(file, f"{label}.{element.tag} = {shown(text_of(element))}: must be three numbers")
    return [number(word, file, f"{label}.{element.tag}") for word in words]
