"""Read a page of results back: its elements, and the documents of its plots."""

import gzip
import json
import re
from base64 import b64decode
from html.parser import HTMLParser

EMPTY = {"meta", "link", "img", "br", "input"}


class Reader(HTMLParser):
    """Elements of a page: (tag, attributes, text inside), in the order in which they end."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements = [], []
        self.feed(text)
        assert not self.open, f"never closed: {self.open}"

    def handle_starttag(self, tag, attributes):
        element = (tag, dict(attributes), [])
        (self.elements if tag in EMPTY else self.open).append(element)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes), []))

    def handle_data(self, data):
        for element in self.open:
            element[2].append(data)

    def handle_endtag(self, tag):
        element = self.open.pop()
        assert element[0] == tag, f"{tag} closes {element[0]}"
        self.elements.append(element)

    def all(self, tag, **attributes):
        return [
            (told, " ".join("".join(words).split()))
            for name, told, words in self.elements
            if name == tag and attributes.items() <= told.items()
        ]


def documents(text):
    """The documents of plots of a page, one a figure, in the order of the page."""
    held = re.findall(r'<script type="application/gzip" class="plots">(.*?)</script>', text)
    return [json.loads(gzip.decompress(b64decode(one))) for one in held]
