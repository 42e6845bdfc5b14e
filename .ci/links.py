#!/usr/bin/env python3
"""Finds broken links in the documentation.

Checks four things in the files that git tracks:

- Each relative link of a Markdown file leads to a file or folder that exists.
- Each anchor (`page.md#heading`) is a heading of that page, or an `id` in it. Headings get the anchors that GitHub
  makes: lower case, without punctuation, hyphens for spaces, and a number for a heading that occurs twice.
- A link whose text is the name of a page (`[media.md](media.md)`) leads to a page of that name.
- Each path `docs/….md` in a file of any kind, such as a comment of the code or a help text, leads to a page that exists.

Links to other sites are not followed. Code blocks and code spans of Markdown have no links.

    python3 .ci/links.py            from the root of the repository

Prints `FILE:LINE: what is wrong` for each fault, and exits with 1 if there is one.
"""

import os
import re
import subprocess
import sys
from urllib.parse import unquote

FENCE = re.compile(r"^\s*(```+|~~~+)")
HEADING = re.compile(r"^#{1,6}\s+(.*?)\s*#*\s*$")
ID = re.compile(r"""\b(?:id|name)=["']([^"']+)["']""")
# [text](target), [text](target "title"), ![text](target); the text may contain brackets once.
LINK = re.compile(r"\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\(\s*<?([^()\s>]+(?:\([^()\s]*\)[^()\s>]*)?)>?(?:\s+\"[^\"]*\")?\s*\)")
REFERENCE = re.compile(r"^\s{0,3}\[([^\]]+)\]:\s*<?(\S+?)>?\s*$", re.M)
SPAN = re.compile(r"(`+)(?:.|\n)*?\1")
PAGE = re.compile(r"(?<![\w/.-])((?:\.\./)*)(docs/[\w./-]+?\.md)(#[\w-]+)?")
NAME = re.compile(r"^[\w./-]+\.md$")
OTHER_SITE = re.compile(r"^[a-z][a-z0-9+.-]*:", re.I)


def tracked():
    """Paths of all files in git's index that are on the disk."""
    names = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True).stdout.decode()
    return [name for name in names.split("\0") if name and os.path.isfile(name)]


def without_code(text):
    """`text` with code blocks and code spans blanked, so that the numbers of lines stay."""
    lines, fence = [], None
    for line in text.split("\n"):
        if fence:
            if line.strip().startswith(fence) and not line.strip().strip(fence[0]):
                fence = None
            lines.append("")
        elif match := FENCE.match(line):
            fence = match.group(1)
            lines.append("")
        else:
            lines.append(line)
    return SPAN.sub(lambda span: re.sub(r"[^\n]", " ", span.group(0)), "\n".join(lines))


def anchors(text):
    """The anchors of a Markdown page: its headings as GitHub names them, and its `id` attributes."""
    found, fence = set(), None
    for line in text.split("\n"):
        if fence:
            if line.strip().startswith(fence):
                fence = None
            continue
        if match := FENCE.match(line):
            fence = match.group(1)
            continue
        found.update(ID.findall(line))
        if match := HEADING.match(line):
            title = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", match.group(1))
            title = re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-")
            name, count = title, 0
            while name in found:
                count += 1
                name = f"{title}-{count}"
            found.add(name)
    return found


def line_of(text, position):
    """The number of the line in which `position` lies, from 1."""
    return text.count("\n", 0, position) + 1


class Pages:
    """The anchors of pages, each read once."""

    def __init__(self):
        self.known = {}

    def has(self, path, anchor):
        """Whether the page at `path` has `anchor`."""
        if path not in self.known:
            with open(path, encoding="utf-8") as file:
                self.known[path] = anchors(file.read())
        return anchor in self.known[path]


def faults_of_links(name, text, pages):
    """Faults of the relative links in the Markdown file `name`, as (line, message)."""
    plain = without_code(text)
    for match in [*LINK.finditer(plain), *REFERENCE.finditer(plain)]:
        text_of_link, target = match.groups()
        if OTHER_SITE.match(target):
            continue
        path, _, anchor = target.partition("#")
        path = unquote(path)
        line = line_of(plain, match.start(2))
        if path.startswith("/"):
            place = path.lstrip("/")
        else:
            place = os.path.normpath(os.path.join(os.path.dirname(name), path)) if path else name
        if not os.path.exists(place):
            yield line, f"{target}: no such file"
        elif anchor and place.endswith(".md") and not pages.has(place, unquote(anchor)):
            yield line, f"{target}: no such heading"
        elif NAME.match(text_of_link) and os.path.basename(text_of_link) != os.path.basename(place):
            yield line, f"{text_of_link}: leads to {target}"


def faults_of_paths(text, pages):
    """Faults of the paths `docs/….md` in a file of any kind, as (line, message)."""
    for match in PAGE.finditer(text):
        path, anchor = match.group(2), match.group(3)
        line = line_of(text, match.start(2))
        if not os.path.isfile(path):
            yield line, f"{path}: no such page"
        elif anchor and not pages.has(path, anchor[1:]):
            yield line, f"{path}{anchor}: no such heading"


def main():
    pages, faults = Pages(), []
    for name in tracked():
        try:
            with open(name, encoding="utf-8") as file:
                text = file.read()
        except UnicodeDecodeError:
            continue
        found = set(faults_of_paths(text, pages))
        if name.endswith(".md"):
            found |= set(faults_of_links(name, text, pages))
        faults += [(name, line, message) for line, message in found]
    for name, line, message in sorted(faults):
        print(f"{name}:{line}: {message}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
