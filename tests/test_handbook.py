"""The pages of the repository, as text: paragraphs that are whole."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    page
    for page in ROOT.rglob("*.md")
    if not {"node_modules", ".venv"} & set(page.parts) and not page.is_relative_to(ROOT / ".git")
)
ENDS = (".", ":", ";", "!", "?", ")", "|", ">", "`", "*")


def paragraphs(text: str) -> list[list[str]]:
    """Without code, tables, headings, and what leads in to code."""
    found: list[list[str]] = [[]]
    code = False
    for line in text.splitlines():
        if line.startswith("```"):
            if not code and not found[-1]:
                del found[-2:]
            code = not code
            found.append([])
        elif code or not line.strip() or line.startswith(("|", "# ", "##", "<!--")):
            found.append([])
        else:
            found[-1].append(line)
    return [one for one in found if one]


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_no_paragraph_is_broken_in_mid_sentence(page: Path) -> None:
    for one in paragraphs(page.read_text(encoding="utf-8")):
        assert one[-1].rstrip().endswith(ENDS), f"{one[-1]!r} has no end"
        assert not any(line != line.rstrip() for line in one), f"{one[0]!r}: spaces at the end of a line"
