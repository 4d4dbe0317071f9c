"""The reproduction as HTML: an index, and one self-contained page per document in the order of the original."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path

import pandas as pd

from pipeline.common.errors import ConfigError
from pipeline.common.files import write_beside
from pipeline.config.documents import Document, Drawing, Place
from pipeline.reproduce.drawings import DRAW
from pipeline.reproduce.recompute import Runs
from pipeline.reproduce.results import ResultError
from pipeline.reproduce.table import counts
from pipeline.reproduce.tables import HEAD, TIMES, cells, sentence
from pipeline.reproduce.verdict import NOT_RUN, TIMING

DPI = 90
INDEX = "reproduction.html"
STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1a202c; max-width: 1150px; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid #d5d9df }
h2 span { font-weight: 400; color: #5a6472 }
table { border-collapse: collapse; margin: .8rem 0; font-size: .88rem }
th, td { text-align: left; vertical-align: top; padding: .25rem .7rem .25rem 0; border-bottom: 1px solid #e2e8f0 }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap }
td.note { color: #5a6472 } code { font-size: .85em }
img { max-width: 100%; display: block; margin: .8rem 0 }
.verdict { border-radius: .6rem; padding: .05rem .55rem; white-space: nowrap }
.reproduced { background: #d8f0df } .better { background: #d7e7fa } .misprint { background: #fbeecb }
.differs { background: #fadbd8 } .timing, .not { background: #edf2f7 }
"""


def write(folder: Path, documents: Sequence[Document], table: pd.DataFrame, runs: Runs) -> list[Path]:
    """The index and a page per document in `folder`; returns the files, the index first."""
    pages = {INDEX: index(documents, table)}
    for document in documents:
        own = table[table["document"] == document.name]
        pages[f"{document.name}.html"] = page(document, own, runs)
    for name, content in pages.items():
        write_beside(folder / name, partial(Path.write_text, data=content, encoding="utf-8"))
    return [folder / name for name in pages]


def index(documents: Sequence[Document], table: pd.DataFrame) -> str:
    """How many of each verdict per document, and what differs, with the reason."""
    verdicts = counts(table)
    head = ["document", *verdicts, "in all"]
    rows = []
    for document in documents:
        own = table[table["document"] == document.name]
        link = f'<a href="{document.name}.html">{escape(document.title)}</a><br>{escape(document.source)}'
        rows.append([link, *(str(counts(own).get(name, 0)) for name in verdicts), str(sum(counts(own).values()))])
    rows.append(["all", *map(str, verdicts.values()), str(sum(verdicts.values()))])
    body = f"<h1>Printed and recomputed</h1><p>{escape(sentence(table))}.</p>{_table(head, rows)}"
    kinds = (
        ("differs", "What differs, and why"),
        ("misprint", "Misprints"),
        ("better", "Better"),
        (NOT_RUN, "Not run yet"),
        (TIMING, TIMES),
    )
    for verdict, title in kinds:
        own = table[table["verdict"] == verdict]
        if len(own):
            body += f"<h2>{title}</h2>{_numbers(own, with_document=True)}"
    return _html("Printed and recomputed", body)


def page(document: Document, table: pd.DataFrame, runs: Runs) -> str:
    """Every table and figure of one document, in its order."""
    body = f'<p><a href="{INDEX}">all documents</a></p><h1>{escape(document.title)}</h1>'
    body += f"<p>{escape(document.source)}. {escape(sentence(table))}.</p>"
    for place in document.places:
        body += f"<h2>{escape(place.place)} <span>{escape(place.caption)}</span></h2>"
        if place.inputs:
            body += _table(["given", ""], [[escape(name), escape(value)] for name, value in place.inputs.items()])
        body += "".join(_figure(place, drawing, runs) for drawing in place.figures)
        own = table[table["place"] == place.place]
        if place.rows:
            body += _numbers(own)
    return _html(document.title, body)


def _figure(place: Place, drawing: Drawing, runs: Runs) -> str:
    """The figure within the page; one line instead if its runs have not left what it shows."""
    if drawing.draw not in DRAW:
        raise ConfigError(f"{place.place}: draw = {drawing.draw}: allowed: {', '.join(DRAW)}")
    try:
        title = f"{place.place}, drawn again ({', '.join(drawing.experiments)})"
        figure = DRAW[drawing.draw]([runs[name] for name in drawing.experiments], drawing.methods, title)
    except (ResultError, KeyError) as error:
        return f"<p>Not drawn: {escape(str(error))}.</p>"
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DPI)
    content = base64.b64encode(picture.getvalue()).decode("ascii")
    return f'<img alt="{escape(place.place)}: {escape(place.caption)}" src="data:image/png;base64,{content}">'


def _numbers(table: pd.DataFrame, with_document: bool = False) -> str:
    """The rows of reproduction.csv as a table, each with the command that gives it."""
    first = 0 if with_document else 1
    rows = []
    for row in table.to_dict("records"):
        words = [escape(cell) for cell in cells(row)]
        verdict = f'<span class="verdict {words[5]}">{words[5]}</span>'
        words = [*words[:5], verdict, *words[6:], f"<code>{escape(str(row['command']))}</code>"]
        words[0] = f"{escape(str(row['document']))}, {words[0]}" if with_document else words[0]
        rows.append(words[first:])
    head = [*HEAD, "command"][first:]
    shown = [column for column in range(len(head)) if any(row[column] for row in rows)]
    return _table([head[column] for column in shown], [[row[column] for column in shown] for row in rows])


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    classes = {"printed": "number", "recomputed": "number", "difference": "number", "note": "note"}
    marked = [f' class="{classes[title]}"' if title in classes else "" for title in head]
    lines = ["<tr>" + "".join(f"<th>{escape(title)}</th>" for title in head) + "</tr>"]
    for row in rows:
        lines.append("<tr>" + "".join(f"<td{m}>{cell}</td>" for m, cell in zip(marked, row, strict=True)) + "</tr>")
    return f"<table>{''.join(lines)}</table>"


def _html(title: str, body: str) -> str:
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head><body>{body}</body></html>\n"
    )
