"""Text on a terminal or in a redirected stream: characters that its encoding lacks, tables, and texts from files.

A name in a file must neither control a terminal nor change how a table looks: all text passes
`cspr_jax.errors.printable`, and none of it is parsed as markup.
"""

import codecs
import io
from typing import IO, TYPE_CHECKING, Any, TextIO

from cspr_jax.errors import printable

if TYPE_CHECKING:
    from rich.text import Text

_PLAINER = "cspr_jax.plainer"
# Replacements of characters in units, tables and progress that an encoding may lack.
_PLAIN = {
    **{"→": "->", "∞": "inf", "±": "+-", "−": "-", "–": "-", "—": "-", "·": "*", "×": "x", "≤": "<=", "≥": ">="},
    **{"²": "^2", "³": "^3", "°": " deg", "Δ": "d", "…": "...", "’": "'", "‘": "'", "“": '"', "”": '"'},
}


def _plainer(error: UnicodeError) -> tuple[str | bytes, int]:
    # Error handler of codecs, which replaces one character at a time.
    if not isinstance(error, UnicodeEncodeError):
        raise error
    sign = error.object[error.start]
    if "\udc80" <= sign <= "\udcff":  # a byte of a file's name that is not valid text: written unchanged
        return bytes([ord(sign) - 0xDC00]), error.start + 1
    return _PLAIN.get(sign) or sign.encode("ascii", "backslashreplace").decode("ascii"), error.start + 1


codecs.register_error(_PLAINER, _plainer)


def encodable(stream: IO[str]) -> None:
    """Make a stream accept any text: characters that its encoding lacks become plainer ones, or escapes."""
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors=_PLAINER)


def plainer(text: str, encoding: str | None) -> str:
    """Text as a stream of this encoding shows it."""
    return text.encode(encoding, _PLAINER).decode(encoding) if encoding else text


def cell(*lines: object, style: str = "") -> "Text":
    """Text of a cell, head, title or note of a table of rich, which is not parsed as markup."""
    from rich.text import Text  # imported only where tables are printed

    return Text("\n".join(map(printable, lines)), style=style)


def print_table(renderable: Any, file: TextIO) -> None:
    """Print a table of rich whose texts are instances of `Text`; characters that the encoding lacks are replaced."""
    from rich.console import Console as Usual

    class Console(Usual):
        def on_broken_pipe(self) -> None:
            # rich would end the process, with an exit code that has another meaning in this program.
            raise BrokenPipeError

    _fit(renderable, file.encoding)
    # Lines for a pipe get a fixed width, so that no column is folded.
    width = None if file.isatty() else 140
    Console(file=file, width=width, highlight=False, markup=False, emoji=False).print(renderable)


def _fit(part: Any, encoding: str | None) -> None:
    # Replace characters before columns get their widths, since replacements may be longer.
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    if isinstance(part, Text):
        part.plain = plainer(part.plain, encoding)
    elif isinstance(part, Group):
        for inner in part.renderables:
            _fit(inner, encoding)
    elif isinstance(part, Table):
        _fit(part.title, encoding)
        _fit(part.caption, encoding)
        for column in part.columns:
            for inner in (column.header, *column.cells):
                _fit(inner, encoding)
