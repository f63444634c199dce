"""Small pieces of HTML: escaped text, numbers with a sensible number of digits, tables, pictures, and the page around them."""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from rf_pointing.report.page_style import STYLE_SHEET

__all__ = ["Cell", "document", "figure", "number", "table", "text"]

Cell = str | float | int | None
_ABSENT = "–"


def document(title: str, parts: Iterable[str]) -> str:
    """Return a whole page of `parts`, empty ones left out, that needs no other file."""
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{text(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE_SHEET}</style></head>\n'
        f"<body>\n{''.join(part + chr(10) for part in parts if part)}</body></html>\n"
    )


def figure(path: Path, title: str, caption: str, *, narrow: bool = False) -> str:
    """Return the PNG at `path`, embedded, between its title and its caption."""
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    narrowed = ' class="narrow"' if narrow else ""
    return (
        f"<figure{narrowed}><h3>{text(title)}</h3>"
        f'<div class="scroll"><img alt="{text(title)}" src="data:image/png;base64,{data}"></div>'
        f"<figcaption>{text(caption)}</figcaption></figure>"
    )


def text(value: object) -> str:
    """Return `value` escaped for HTML."""
    return escape(str(value))


def number(value: float | int | None, digits: int = 3) -> str:
    """Return a number with `digits` significant figures, never in powers of ten; a dash where there is none."""
    if value is None:
        return _ABSENT
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")
    if value == 0.0:
        return "0"
    shown = float(f"{value:.{digits}g}")
    decimals = max(0, digits - 1 - _exponent(shown))
    return f"{shown:,.{min(decimals, 9)}f}".replace(",", "\u202f")


def _exponent(value: float) -> int:
    return int(f"{abs(value):e}".partition("e")[2])


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]], *, words: Sequence[int] = (0,)) -> str:
    """Return a table that scrolls sideways on a narrow page; columns in `words` hold text, the others numbers."""
    body = "".join(f"<tr>{''.join(_cell(value, i in words) for i, value in enumerate(row))}</tr>" for row in rows)
    titles = "".join(f"<th{_kind(i in words)}>{text(title)}</th>" for i, title in enumerate(head))
    return f'<div class="scroll"><table><thead><tr>{titles}</tr></thead><tbody>{body}</tbody></table></div>'


def _cell(value: Cell, words: bool) -> str:
    if isinstance(value, str) or value is None:
        shown = text(value) if value else _ABSENT
        return f"<td{_kind(words, long=len(shown) > 40)}>{shown}</td>"
    return f"<td>{number(value)}</td>"


def _kind(words: bool, *, long: bool = False) -> str:
    names = [name for name, wanted in (("text", words), ("long", long)) if wanted]
    return f' class="{" ".join(names)}"' if names else ""
