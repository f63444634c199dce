"""Style sheet of the report page: readable on a screen, on a phone, and printed.

Small pieces of HTML: escaped text, numbers with a sensible number of digits, tables, pictures, and the page around them.
"""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

__all__ = ["STYLE_SHEET", "Cell", "document", "figure", "number", "table", "text"]


STYLE_SHEET = """
:root { --ink: #1d2327; --soft: #5b6570; --line: #d9dee3; --good: #00734f; --bad: #b23a00; --paper: #ffffff; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1180px; padding: 1.2rem; color: var(--ink); background: var(--paper);
  font: 16px/1.5 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .6rem; padding-top: .8rem; border-top: 1px solid var(--line); }
p { margin: .4rem 0; }
.soft, figcaption { color: var(--soft); font-size: .92rem; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(230px, 1fr)); gap: .7rem; margin: 1.2rem 0; }
.tile { border: 1px solid var(--line); border-radius: 8px; padding: .7rem .9rem; }
.tile b { display: block; font-size: 1.4rem; line-height: 1.25; font-weight: 600; }
.tile span { display: block; color: var(--soft); font-size: .88rem; }
.good b { color: var(--good); }
.bad b { color: var(--bad); }
.notice { border-left: 4px solid var(--bad); background: #fdf3ee; padding: .6rem 1rem; margin: 1rem 0; }
.notice ul { margin: .3rem 0; padding-left: 1.2rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .3rem .6rem; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { font-weight: 600; vertical-align: bottom; white-space: normal; line-height: 1.25; }
th:first-child, td:first-child, .text { text-align: left; }
td.long { white-space: normal; min-width: 12rem; }
figure { margin: 1rem 0 1.6rem; break-inside: avoid; }
figure img { width: 100%; height: auto; display: block; }
figure.narrow img { max-width: 620px; margin: 0 auto; }
h3 { font-size: 1.05rem; margin: 1.4rem 0 .3rem; }
@media (max-width: 600px) { body { padding: .8rem; font-size: 15px; } h1 { font-size: 1.35rem; }
  .tiles { grid-template-columns: repeat(2, 1fr); } .tile b { font-size: 1.15rem; }
  figure:not(.narrow) img { width: 720px; } }
@media print { body { max-width: none; padding: 0; font-size: 10.5pt; } h2 { break-after: avoid; }
  .scroll { overflow: visible; } table { font-size: 8.5pt; } th, td { padding: .15rem .35rem; }
  tr { break-inside: avoid; }
  .tile { break-inside: avoid; } .tiles { grid-template-columns: repeat(4, 1fr); } }
""".strip()

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
