"""Pages of HTML that need no other file: head, style and tables."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

STYLE = (
    "body{font:16px/1.45 sans-serif;margin:2rem auto;max-width:56rem;padding:0 1rem;color:#111;"
    "background:#fff}"
    "table{border-collapse:collapse;margin:.5rem 0 1.5rem;font-size:.92rem}"
    "th,td{text-align:left;padding:.25rem .9rem .25rem 0;border-bottom:1px solid #bbb;vertical-align:top}"
    "td{font-variant-numeric:tabular-nums}svg{max-width:100%;height:auto}text{font:12px sans-serif}"
)


def document(title: str, language: str, body: str) -> str:
    """The whole of it; ``title`` is its heading, too."""
    title = escape(title)
    return (
        f'<!doctype html>\n<html lang="{language}"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n{body}</body></html>\n"
    )


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Each row begins with its name; without ``heads`` there is no first row."""
    head = "".join(f'<th scope="col">{escape(one)}</th>' for one in heads)
    body = "".join(
        f'<tr><th scope="row">{escape(first)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in more)}</tr>'
        for first, *more in rows
    )
    return f"<table>{f'<thead><tr>{head}</tr></thead>' if head else ''}<tbody>{body}</tbody></table>\n"
