"""How the report looks."""

STYLE = """
:root { color-scheme: light; --ink: #23272e; --soft: #6a717c; --line: #e3e6ea; --raw: #e66c37; --fault: #d6303c; }
* { box-sizing: border-box; }
body { margin: 0; background: #f6f7f9; color: var(--ink); font: 15px/1.5 system-ui, "Segoe UI", Roboto, sans-serif; }
main { max-width: 1040px; margin: 0 auto; padding: 28px 24px 60px; }
h1 { font-size: 25px; margin: 0 0 4px; overflow-wrap: anywhere; }
h2 { font-size: 18px; margin: 34px 0 8px; }
h3 { font-size: 14px; margin: 0 0 4px; font-weight: 600; }
h3 span, p.soft { color: var(--soft); font-weight: 400; }
section.card { background: #fff; border: 1px solid var(--line); border-radius: 8px; }
section.card { padding: 14px 16px; margin: 10px 0; }
.tiles { display: flex; flex-wrap: wrap; gap: 10px; margin: 16px 0; }
.tiles div { background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: 8px 16px; }
.tiles b { display: block; font-size: 19px; }
.tiles .held b, td.held { color: #1d7d4c; }
.tiles .broken b, td.broken { color: var(--fault); font-weight: 700; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 13.5px; font-variant-numeric: tabular-nums; }
th { text-align: left; color: var(--soft); font-weight: 500; }
th, td { padding: 3px 10px 3px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.number { text-align: right; padding-right: 18px; }
svg { display: block; width: 100%; height: auto; }
svg text { font-size: 11px; fill: var(--soft); } svg text.y { text-anchor: end; } svg text.x { text-anchor: middle; }
.grid { stroke: #eceef1; fill: none; } .bar { fill: none; stroke-width: 1.2; stroke-dasharray: 5 4; }
.curve { fill: none; stroke-width: 1.5; stroke-linejoin: round; stroke-linecap: round; } .fault { opacity: 0.16; }
.legend { display: flex; gap: 18px; font-size: 13px; color: var(--soft); }
.legend i { display: inline-block; width: 18px; height: 3px; margin-right: 6px; vertical-align: middle; }
.legend i.block { height: 12px; opacity: 0.25; background: var(--fault); }
.worst { display: grid; grid-template-columns: minmax(260px, 5fr) 6fr; gap: 16px; align-items: center; }
.worst img { width: 100%; height: auto; border-radius: 4px; }
@media (max-width: 760px) { .worst { grid-template-columns: 1fr; } }
"""
