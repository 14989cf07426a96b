"""The page of functions and classes: signatures and docstrings of the public names."""

import inspect
import re
import textwrap
from typing import Any

import cspr_jax

HEAD = """# Functions and classes

Built from the docstrings of the package. Executed examples are in [from Python](../python.md). Arrays are in SI units
and radians, in the axes of the robot file. All errors that a mistake raises are subclasses of
`cspr_jax.errors.CsprError`.
"""
WIDTH = 120
SECTION = re.compile(r"(Args|Returns|Raises|Fields|Yields):")
ENTRY = re.compile(r"(\*{0,2}\w+): (.*)", re.DOTALL)


def page_text() -> str:
    """The page.

    Returns:
        Markdown.
    """
    return "\n".join([HEAD, *(_entry(name, getattr(cspr_jax, name), "##") for name in cspr_jax.__all__)])


def _entry(name: str, one: Any, mark: str) -> str:
    lines = [f"{mark} {name}", ""]
    if not inspect.isclass(one):
        lines += ["```text", _signature(name.rpartition(".")[2], one), "```", ""]
    lines += [_markdown(inspect.getdoc(one) or "")]
    if inspect.isclass(one):
        methods = [(key, value) for key, value in vars(one).items() if inspect.isfunction(value) and key[0] != "_"]
        lines += [_entry(f"{name}.{key}", value, mark + "#") for key, value in methods]
    return "\n".join(lines)


def _signature(name: str, function: Any) -> str:
    # A parameter a line, without types of Python: the text says which arrays and texts they are.
    parts, is_keyword = [], False
    for key, one in inspect.signature(function).parameters.items():
        if one.kind is one.KEYWORD_ONLY and not is_keyword:
            is_keyword = True
            parts.append("*")
        if key != "self":
            parts.append(key if one.default is one.empty else f"{key}={one.default!r}")
    line = f"{name}({', '.join(parts)})"
    return line if len(line) <= 110 else f"{name}(\n    " + ",\n    ".join(parts) + ",\n)"


def _markdown(text: str) -> str:
    # Sections of a docstring become lists.
    parts = []
    for block in text.split("\n\n"):
        head, _, rest = block.partition("\n")
        section = SECTION.fullmatch(head)
        if section is None:
            parts.append(textwrap.fill(" ".join(block.split()), WIDTH, break_long_words=False))
            continue
        items: list[str] = []
        for line in textwrap.dedent(rest).splitlines():
            if (line.startswith(" ") and items) or (section[1] in ("Returns", "Yields") and items):
                items[-1] += " " + line.strip()
            else:
                items.append(line)
        entries = [ENTRY.fullmatch(item) for item in items]
        listed = [
            f"- `{m[1]}`: {m[2]}" if m and section[1] != "Returns" else f"- {item}"
            for m, item in zip(entries, items, strict=True)
        ]
        wrapped = [textwrap.fill(item, WIDTH, subsequent_indent="  ", break_long_words=False) for item in listed]
        parts.append(f"**{section[1]}**\n\n" + "\n".join(wrapped))
    return "\n\n".join(parts) + "\n"
