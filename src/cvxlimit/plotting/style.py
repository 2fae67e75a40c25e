"""All colours of pictures and charts, in one table."""

from __future__ import annotations


class Style:
    """What colours stand for. Areas are light and pale, so that lines and coloured joints are seen
    on them; scales go from light to dark, so that they also read in grey and to colour-blind
    eyes, and are far from the colours of joints."""

    # Lines and marks, of charts and of joints that open, slide and twist.
    blue, red, amber, violet = "#134b73", "#d62246", "#f59e0b", "#8b2fc9"
    green, teal, brown = "#2a9d5c", "#12a4b4", "#b3541e"
    series = (blue, red, green, amber, violet, teal)
    axis, thin, grid = "#888888", "#555555", "#d9d9d9"

    # Of many methods in one chart: no colour twice, further ones are grey. Fronts lie behind them.
    methods = (red, green, "#c77f00", violet, "#0f8a97", "#7a5230", "#d04c96", "#7f8f00", "#3b5bdb",
               "#b45309")  # fmt: skip
    other = "#767d88"
    fronts = ("#4aa3a8", "#c77dba", "#c9a227")

    # From nothing to the largest: speed of blocks, share of strength in use.
    speed = ("#f4f1e6", "#cfe3d4", "#8fc8bd", "#4aa3a8", "#1f7791", blue)
    use = ("#f7e8c8", "#f0b56b", "#d9743f", "#9e3251", "#4a1a5c")
    idle = "#dfe1e4"

    # Blocks: supports, free ones without a mechanism, those behind lines, those to blame.
    support, stone, pale, culprit = "#a3a09a", "#d9d0bd", "#efeae0", "#ee6c5b"
    face, glass, ghost, shadow = "#4b4e53", "#a9adb4", "#b4b7bd", "#26263a"
    ghost_key = ("#e9ebee", "#9aa0ab")

    # What lies over them.
    bed, head, sloping = "#1b6ca8", "#c2571a", "#5b8c2a"
    dead, live = "#3b4252", "#c2185b"
    centre, force, thrust = "#b3123c", "#1b5e9c", "#123f6b"
    crushed, tie, yielding = "#7a1010", "#5d6b82", "#0a7d4f"
    mark, ink = "#d00000", "#4a4f57"
