"""What tests ask of a page of HTML."""

from __future__ import annotations

import html
import re
from html.parser import HTMLParser


def words(page: str) -> str:
    """Return a page's text, as a browser shows it."""
    return html.unescape(re.sub(r"<[^>]+>", " ", page))


class Addresses(HTMLParser):
    """The addresses that a page holds.

    Attributes
    ----------
    loaded, linked : list of str
        What a browser fetches by itself, and what a reader may follow.
    anchors : set of str
        What a link may point at within the page.
    """

    def __init__(self, html: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.linked: list[str] = []
        self.anchors: set[str] = set()
        self._ignored = {"canonical", "next", "prev"}
        self.feed(html)
        styles = "".join(re.findall(r"<style>(.*?)</style>", html, re.DOTALL))
        self.loaded += re.findall(r"@import\s+['\"]?([^'\";]+)", styles)
        self.loaded += re.findall(r"url\(['\"]?([^'\")]+)", styles)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        for name in ("src", "srcset", "data"):
            if name in values:
                self.loaded.append(values[name])
        if "href" in values:
            if tag == "a":
                self.linked.append(values["href"])
            elif values.get("rel") not in self._ignored:
                self.loaded.append(values["href"])
