"""A hook of MkDocs: equations become MathML when the site is built, so that no script and no network draws them."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

EQUATION = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """The page's HTML with each equation of pymdownx.arithmatex as MathML."""
    return EQUATION.sub(_mathml, content)


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found[2] == "[" else "inline"
    return f'<{found[1]} class="equation">{convert(html.unescape(found[3]).strip(), display=display)}</{found[1]}>'
