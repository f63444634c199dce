"""Style sheet of the report page: readable on a screen, on a phone, and printed."""

__all__ = ["STYLE_SHEET"]

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
