"""Pages stand alone, escape what users wrote, and are well-formed."""

from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiation_ss import page, style

VOID = {"meta", "link", "img", "br"}


class Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.addresses += [value for name, value in attrs if name in ("src", "href", "action")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def read(document: str) -> Reader:
    reader = Reader()
    reader.feed(document)
    reader.close()
    assert reader.open == []
    return reader


def test_page_asks_nothing_of_the_network():
    figure, axes = style.figure()
    axes[0, 0].plot([0, 1], [1, 0])
    blocks = [page.Picture(figure, "A line"), page.Text("x"), page.Points(["a", "b"]),
              page.Table(["n", "v"], [["1", "2"]]), page.Verdict("Fine", "good")]
    whole = page.Page("Heave", [page.Part("Where", blocks)])
    reader = read(page.render(whole))
    page.close_figures(whole)
    assert reader.addresses and all(address.startswith("data:") for address in reader.addresses)


def test_notebooks_show_text_and_picture():
    """At most ten lines of text, the last of what is left out, escaped; a picture that matplotlib wrote as SVG."""
    class Result:
        def __str__(self):
            return "\n".join(["<b>"] + [str(k) for k in range(30)])

        def plot(self):
            figure, axes = style.figure()
            axes[0, 0].plot([0, 1], [1, 0])
            return figure

    text, _, picture = page.fragment(Result()).partition("<svg")
    assert "".join(read(text).text).splitlines() == ["<b>", *map(str, range(8)), "... 22 more lines: print() shows all"]
    assert ElementTree.fromstring("<svg" + picture).tag.endswith("}svg")


@given(st.text(min_size=1))
def test_user_text_is_shown_and_never_run(text):
    whole = page.Page(text, [page.Part(text, [page.Text(text), page.Table([text], [[text]]), page.Verdict(text)])])
    document = page.render(whole)
    assert "<script" not in document.lower()
    read(document)


@pytest.mark.parametrize("value, shown", [
    (None, "–"), (float("nan"), "–"), (0.0, "0"), (-1.5, "-1.5"), (0.123456, "0.123"), (12345.6, "12300"),
    (3e-9, "3e-09")])
def test_numbers(value, shown):
    assert page.number(value) == shown


@pytest.mark.parametrize("value, deviation, shown", [
    (150.0, 3.1, "150.0 ± 3.1 N"), (1.193e10, 1.5e8, "(1.193 ± 0.015)e10 N"), (0.0, 2.0e6, "(0.0 ± 2.0)e6 N"),
    (-2.5e-7, 1.0e-8, "(-2.50 ± 0.10)e-7 N"), (0.4165, 0.007255, "0.4165 ± 0.0073 N"),
    (12345.0, 670.0, "12345 ± 670 N"),
    (2.0, 0.0, "2 N"), (2.0, float("nan"), "2 N"),
])
def test_value_and_deviation_share_their_last_place(value, deviation, shown):
    assert page.with_error(value, deviation, "N") == shown
