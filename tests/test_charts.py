"""Charts of the benchmarks, drawn again from the stored results: nothing is cut or collides."""

import json
import sys
from itertools import combinations

import growth
import label_accuracy
import pareto
import peers
import pytest
import throughput
from matplotlib.text import Text
from reporting import RESULTS

BENCHES = {
    module.__name__: module for module in (growth, label_accuracy, pareto, peers, throughput)
}


@pytest.fixture(scope="module", params=sorted(BENCHES))
def chart(request):
    """The figure that a benchmark draws of its stored results."""
    stored = json.loads((RESULTS / f"{request.param}.json").read_text())
    figure = BENCHES[request.param].draw(stored)
    figure.canvas.draw()
    yield figure
    figure.clear()


def written(figure):
    """Return the text and the box in pixels of everything that is written and visible."""
    texts = figure.findobj(Text, include_self=False)
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
                if not axis.get_visible() or not low <= tick.get_loc() <= high:
                    hidden |= {tick.label1, tick.label2}
    return [
        (text.get_text(), text.get_window_extent())
        for text in texts
        if text not in hidden and text.get_visible() and text.get_text().strip()
    ]


def test_no_text_is_cut_and_no_two_texts_overlap(chart):
    texts = written(chart)
    assert len(texts) > 20
    low, high = chart.bbox.min, chart.bbox.max
    cut = [words for words, box in texts if (box.min < low).any() or (box.max > high).any()]
    assert cut == []
    pairs = combinations(texts, 2)
    assert [(a, b) for (a, one), (b, other) in pairs if one.overlaps(other)] == []


def test_every_point_is_inside_its_axes_and_not_under_the_legend(chart):
    for axes in chart.axes:
        frame, legend = axes.bbox, axes.get_legend()
        for line in axes.lines:
            if line.get_marker() in (None, "None", ""):
                continue
            for x, y in axes.transData.transform(line.get_xydata()):
                # zero may lie on an axis; the other borders stay clear of points
                assert frame.x0 <= x <= frame.x1 - 3, axes.get_xlabel()
                assert frame.y0 <= y <= frame.y1 - 3, axes.get_ylabel()
                assert not (legend and legend.get_window_extent().contains(x, y))


def test_redraw_writes_the_chart_without_measuring(tmp_path, monkeypatch):
    chart = tmp_path / "new" / "chart.png"
    monkeypatch.setattr(sys, "argv", ["peers.py", "--redraw", "--chart", str(chart)])
    monkeypatch.setattr(peers, "run", None)  # would fail if called
    peers.main()
    assert chart.read_bytes().startswith(b"\x89PNG")
