"""Pages of HTML that stand alone: no script, no font, no picture from elsewhere."""

from __future__ import annotations

import html
import re

import markdown

# A picture on a line of its own, and its caption in italics below.
_PICTURE = re.compile(r"^!\[.*\]\(.*\)\n(?:\n\*.*\*\n)?", re.MULTILINE)

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1e293b; margin: 1rem auto; padding: 0 1rem;
  max-width: 76rem; overflow-wrap: break-word; }
h1 { font-size: 1.35rem; } h2 { font-size: 1.1rem; margin-top: 1.6rem; }
h1, h2 { line-height: 1.25; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.87rem; overflow-wrap: normal; }
th { text-align: left; background: #f1f5f9; }
th, td { padding: 0.3rem 0.6rem; border-bottom: 1px solid #cbd5e1; vertical-align: top; }
td { min-width: 3em; max-width: 32em; }
pre { font-size: 0.8rem; overflow-x: auto; background: #f8fafc; padding: 0.8rem; }
code { font-family: ui-monospace, monospace; }
"""


def html_page(title: str, text: str) -> str:
    """Lay Markdown out as one page that needs no other file.

    Parameters
    ----------
    title : str
        For the browser's tab, and the page's heading where the text has none.
    text : str
        Markdown with tables and fenced code. Pictures are left out, with the caption below them:
        the report shows each as a result of its own.

    Returns
    -------
    str
        HTML; tables wider than the window scroll by themselves.
    """
    text = _PICTURE.sub("", text)
    if not text.startswith("# "):
        text = f"# {title}\n\n{text}"
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n{html_of(text)}\n</body>\n</html>\n"
    )


def html_of(text: str) -> str:
    """Turn Markdown into HTML; tables wider than the window scroll by themselves."""
    body = markdown.markdown(text, extensions=["tables", "fenced_code", "sane_lists"])
    body = body.replace("<table>", '<div class="wide"><table>')
    return body.replace("</table>", "</table></div>")
