"""What holds of every figure: words stay on the paper, apart, and can be read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

SMALLEST = 7.0
"""Points; journals ask for 6 to 8 in print."""


def assert_legible(figure: Figure, least: int = 10) -> None:
    """All words of a figure, ``least`` or more."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    texts = [t for t in texts if t.axes is None or t.axes.axison or t in t.axes.texts]
    beyond = {label for axes in figure.axes for label in _out_of_view(axes)}
    texts = [text for text in texts if text not in beyond]
    boxes = [text.get_window_extent(renderer) for text in texts]
    page = figure.bbox
    assert len(texts) >= least
    for text, box in zip(texts, boxes, strict=True):
        assert text.get_fontsize() >= SMALLEST, text
        assert box.x0 >= page.x0 - 0.5, text
        assert box.x1 <= page.x1 + 0.5, text
        assert box.y0 >= page.y0 - 0.5, text
        assert box.y1 <= page.y1 + 0.5, text
    for i, one in enumerate(boxes):
        for other, second in zip(texts[:i], boxes[:i], strict=True):
            assert not one.padded(-1.0).overlaps(second.padded(-1.0)), (texts[i], other)


def _out_of_view(axes: Any) -> Iterator[Text]:
    """Labels of ticks that an axis keeps and does not draw."""
    for axis in (getattr(axes, f"{name}axis", None) for name in "xyz"):
        if axis is not None:
            low, high = sorted(axis.get_view_interval())
            edge = 1e-9 * (high - low)
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not low - edge <= tick.get_loc() <= high + edge:
                    yield from (tick.label1, tick.label2)
