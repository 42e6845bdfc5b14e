#!/usr/bin/env python3
"""Holds all Rust files to one style of imports: one `use` per module, `use a::b::{c, d};`, and no nested braces.

rustfmt sorts them, but its option for this (`imports_granularity = "Module"`) needs a nightly compiler.

    python3 .ci/imports.py            from the root of the repository: lists the files that have another style, and fails
    python3 .ci/imports.py --write    rewrites them; run `cargo fmt --all` after it
"""

import re
import subprocess
import sys

# A statement with everything up to its semicolon, at any depth of modules.
USE = re.compile(r"^([ \t]*)((?:pub(?:\([^)]*\))?\s+)?)use\s+([^;]+);[ \t]*\n", re.M)
# The attributes in lines of their own at the end of a text.
ATTRIBUTES = re.compile(r"(?:^[ \t]*#\[[^\n]*\]\n)*\Z", re.M)


def parts(text):
    """`text`, the inside of braces, at its commas outside of deeper braces."""
    depth, start, found = 0, 0, []
    for at, letter in enumerate(text):
        depth += {"{": 1, "}": -1}.get(letter, 0)
        if letter == "," and depth == 0:
            found.append(text[start:at])
            start = at + 1
    found.append(text[start:])
    return [it.strip() for it in found if it.strip()]


def leaves(tree, module=()):
    """The pairs of module and name that a tree of imports has."""
    tree = tree.strip()
    if tree.startswith("{"):
        for part in parts(tree[1:-1]):
            yield from leaves(part, module)
        return
    brace = tree.find("::{")
    if brace >= 0:
        yield from leaves(tree[brace + 2 :], module + tuple(tree[:brace].split("::")))
        return
    path, renamed, name = tree.partition(" as ")
    segments = [it.strip() for it in path.split("::")]
    last = segments[-1] + (f" as {name.strip()}" if renamed else "")
    yield module + tuple(segments[:-1]), last


def written(indent, visibility, imports):
    """The statements of one block of imports with one visibility."""
    modules = {}
    for module, name in imports:
        names = modules.setdefault(module, [])
        if name not in names:
            names.append(name)
    lines = []
    for module, names in modules.items():
        inside = names[0] if len(names) == 1 and not names[0].startswith("self") else "{" + ", ".join(names) + "}"
        lines.append(f"{indent}{visibility}use {'::'.join((*module, inside))};\n")
    return "".join(lines)


def styled(text):
    """`text` with its imports in the style."""
    out, at = [], 0
    found = list(USE.finditer(text))
    while found:
        block = [found.pop(0)]
        # Attributes belong to the one statement behind them, and to each that it becomes.
        attributes = ATTRIBUTES.search(text[: block[0].start()]).group()
        while not attributes and found and found[0].start() == block[-1].end():
            block.append(found.pop(0))
        out.append(text[at : block[0].start()])
        by_kind = {}
        for it in block:
            if "//" in it.group(3):
                raise ValueError(f"a comment inside of an import: {it.group(3)}")
            by_kind.setdefault((it.group(1), it.group(2)), []).extend(leaves(re.sub(r"\s+", " ", it.group(3))))
        statements = "".join(written(*kind, imports) for kind, imports in by_kind.items())
        out.append(statements.replace(";\n", f";\n{attributes}").removesuffix(attributes) if attributes else statements)
        at = block[-1].end()
    return "".join(out) + text[at:]


def normal(text):
    """The imports of `text` as sets, so that their order and their lines don't count."""
    found = []
    for it in USE.finditer(text):
        tree = re.sub(r"\s+", "", it.group(3))
        inside = tree.partition("::{")[2]
        found.append((it.group(1), it.group(2).strip(), tree.partition("::{")[0], frozenset(parts(inside[:-1]))))
    return sorted(map(repr, found))


def main():
    write = "--write" in sys.argv
    listed = subprocess.run(["git", "ls-files", "*.rs"], capture_output=True, text=True, check=True)
    other = []
    for path in listed.stdout.split():
        with open(path, encoding="utf-8") as file:
            text = file.read()
        wanted = styled(text)
        if normal(wanted) == normal(text):
            continue
        other.append(path)
        if write:
            with open(path, "w", encoding="utf-8") as file:
                file.write(wanted)
    for path in other:
        print(f"{path}: {'rewritten' if write else 'its imports are not one `use` per module'}")
    sys.exit(bool(other) and not write)


main()
