#!/usr/bin/env python3
"""Finds circles of imports between the folders of each crate.

Two files depend on each other in a circle if each reaches the other through `crate::…`, `super::…` and `self::…`
paths, in `use` lines and in code. A circle inside one folder is a matter of that folder. A circle that runs through
several folders means that none of them can be read, moved or tested alone: this script lists those and fails.

A path leads to the file that defines its last name: re-exports (`pub use`) are followed, and are no dependency of the
file that has them. Code under `#[cfg(test)]` is left out.

    python3 .ci/circles.py            from the root of the repository
    python3 .ci/circles.py --edges    also prints the imports of which each circle consists

Circles that may stay are in .ci/circles.allow: one per line, as this script prints it, then ` # ` and the reason.
"""

import os
import re
import sys
import tomllib

ALLOW = ".ci/circles.allow"
# A fuzz target has a file of another crate as a module, with stand-ins for what that uses.
SKIPPED = {"target", ".git", "node_modules", "fuzz"}
NAME = r"[A-Za-z_][A-Za-z0-9_]*"
# At the start of a line, so that neither locals nor associated items count.
DEFINITION = re.compile(
    r"^(?:pub(?:\([^)]*\))?\s+)?(?:default\s+|const\s+|async\s+|unsafe\s+|extern\s+\"[^\"]*\"\s+)*"
    rf"(?:fn|struct|enum|trait|const|static|type|union|macro_rules!)\s+(?:mut\s+)?({NAME})",
    re.M,
)
MODULE = re.compile(
    rf"((?:#\[[^\]]*\]\s*)*)(?:pub(?:\([^)]*\))?\s+)?mod\s+({NAME})\s*;"
)
USE = re.compile(r"(pub(?:\([^)]*\))?\s+)?\buse\s+([^;]+);")
PATH = re.compile(rf"(?<![\w:$])({NAME}(?:::{NAME})+)")


def bare(text):
    """`text` with comments removed, and with strings and characters emptied."""
    out, at, size = [], 0, len(text)
    while at < size:
        two = text[at : at + 2]
        if two == "//":
            at = text.find("\n", at)
            at = size if at < 0 else at
        elif two == "/*":
            depth, at = 1, at + 2
            while at < size and depth:
                if text.startswith("/*", at):
                    depth, at = depth + 1, at + 2
                elif text.startswith("*/", at):
                    depth, at = depth - 1, at + 2
                else:
                    at += 1
        elif (raw := re.compile(r'\b(?:b|c)?r(#*)"').match(text, at)) and not (
            at and (text[at - 1].isalnum() or text[at - 1] == "_")
        ):
            end = text.find('"' + raw.group(1), raw.end())
            at = size if end < 0 else end + 1 + len(raw.group(1))
            out.append('""')
        elif text[at] == '"':
            at += 1
            while at < size and text[at] != '"':
                at += 2 if text[at] == "\\" else 1
            at += 1
            out.append('""')
        elif (char := re.compile(r"'(?:\\(?:u\{[^}]*\}|x..|.)|[^\\'])'").match(text, at)):
            at = char.end()
            out.append("' '")
        else:
            out.append(text[at])
            at += 1
    return "".join(out)


def past_block(text, at):
    """The position after the item at `at`, which ends with `;` or a block."""
    depth = 0
    while at < len(text):
        if text[at] in "{([":
            depth += 1
        elif text[at] in "})]":
            depth -= 1
            if depth == 0 and text[at] == "}":
                return at + 1
        elif text[at] == ";" and depth == 0:
            return at + 1
        at += 1
    return at


def without_tests(text):
    """`text` without the items under `#[cfg(test)]`."""
    while found := re.search(r"#\[cfg\((?:all\()?test\b[^\]]*\]", text):
        text = text[: found.start()] + text[past_block(text, found.end()) :]
    return text


def flat(tree):
    """The paths of the tree of a `use`, as (segments, the name here)."""
    tree = tree.strip()
    brace = tree.find("{")
    if brace < 0:
        path, _, name = tree.partition(" as ")
        parts = [part.strip() for part in path.split("::") if part.strip()]
        if parts and parts[-1] == "self":
            parts = parts[:-1]
        if parts:
            yield parts, (name.strip() or parts[-1])
        return
    start = [part.strip() for part in tree[:brace].split("::") if part.strip()]
    inner, depth, begin = tree[brace + 1 : tree.rindex("}")], 0, 0
    pieces = []
    for at, char in enumerate(inner):
        depth += (char == "{") - (char == "}")
        if char == "," and depth == 0:
            pieces.append(inner[begin:at])
            begin = at + 1
    pieces.append(inner[begin:])
    for piece in pieces:
        piece = piece.strip()
        if piece == "self":
            yield start, start[-1]
        elif piece.startswith("self as "):
            yield start, piece[len("self as ") :].strip()
        elif piece:
            for parts, name in flat(piece):
                yield start + parts, name


class File:
    """A module that has a file of its own."""

    def __init__(self, path, module, folder):
        self.path, self.module, self.folder = path, module, folder
        with open(path, encoding="utf-8") as source:
            self.text = without_tests(bare(source.read()))
        self.defined = set(DEFINITION.findall(self.text))
        self.uses = []
        for found in USE.finditer(self.text):
            for parts, name in flat(found.group(2)):
                self.uses.append((bool(found.group(1)), parts, name))
        self.code = USE.sub("", self.text)


class Crate:
    """The modules of one target of a package, by their paths."""

    def __init__(self, root):
        self.modules = {}
        self.add(root, (), os.path.dirname(root))

    def add(self, path, module, folder):
        file = File(path, module, folder)
        self.modules[module] = file
        for attributes, name in MODULE.findall(file.text):
            # Strings are emptied: the path of `#[path = …]` is in the file itself.
            if "path" in attributes:
                with open(path, encoding="utf-8") as source:
                    named = re.search(
                        rf'#\[path\s*=\s*"([^"]+)"\]\s*(?:pub(?:\([^)]*\))?\s+)?mod\s+{name}\s*;', source.read()
                    )
                child = os.path.normpath(os.path.join(os.path.dirname(path), named.group(1)))
                self.add(child, module + (name,), os.path.dirname(child))
                continue
            alone = os.path.join(folder, name + ".rs")
            inside = os.path.join(folder, name, "mod.rs")
            if os.path.exists(alone):
                self.add(alone, module + (name,), os.path.join(folder, name))
            elif os.path.exists(inside):
                self.add(inside, module + (name,), os.path.join(folder, name))

    def absolute(self, file, parts):
        """`parts`, as they stand in `file`, from the root of the crate; `None` for other crates."""
        if parts[0] == "crate":
            return tuple(parts[1:])
        if parts[0] in ("self", "super"):
            base = file.module
            rest = list(parts)
            while rest and rest[0] in ("self", "super"):
                base = base[:-1] if rest[0] == "super" else base
                rest = rest[1:]
            return base + tuple(rest)
        if file.module + (parts[0],) in self.modules:
            return file.module + tuple(parts)
        return None

    def defining(self, path, seen=()):
        """The file that defines `path`, and whether `path` is a module rather than an item of one."""
        if path in self.modules:
            return self.modules[path], True
        if path in seen:
            return None, False
        for length in range(len(path) - 1, -1, -1):
            file = self.modules.get(path[:length])
            if file is None:
                continue
            name, rest = path[length], path[length + 1 :]
            if name in file.defined or name == "*":
                return file, False
            for _, parts, here in file.uses:
                if here != name:
                    continue
                target = self.absolute(file, parts)
                if target is None:
                    # It comes from another crate.
                    return file, False
                if target[: len(path)] != path:
                    found, is_module = self.defining(target + rest, seen + (path,))
                    return (found or file), is_module
            for _, parts, here in file.uses:
                target = here == "*" and self.absolute(file, parts[:-1])
                source = target and self.modules.get(target)
                if source and source is not file and (path, target) not in seen:
                    found, is_module = self.defining(target + (name,) + rest, seen + (path, (path, target)))
                    if found and (name in found.defined or is_module):
                        return found, is_module
            return file, False
        return None, False

    def needs(self, file):
        """The other files that `file` depends on."""
        aliases, paths = {}, []
        for is_public, parts, here in file.uses:
            target = self.absolute(file, parts)
            if target is None:
                continue
            _, is_module = self.defining(target)
            if is_module:
                # What the file takes out of the module counts.
                aliases[here] = target
            elif not is_public:
                paths.append(target)
        for found in PATH.finditer(file.code):
            parts = found.group(1).split("::")
            if parts[0] in aliases:
                paths.append(aliases[parts[0]] + tuple(parts[1:]))
            elif target := self.absolute(file, parts):
                paths.append(target)
        found = (self.defining(path)[0] for path in paths)
        return {other.path for other in found if other and other is not file}


def circles(edges):
    """The strongly connected parts of a graph that have more than one node (Tarjan, without recursion)."""
    index, low, stack, on, out = {}, {}, [], set(), []
    for root in sorted(edges):
        if root in index:
            continue
        work = [(root, iter(sorted(edges[root])))]
        index[root] = low[root] = len(index)
        stack.append(root)
        on.add(root)
        while work:
            node, rest = work[-1]
            for other in rest:
                if other not in index:
                    index[other] = low[other] = len(index)
                    stack.append(other)
                    on.add(other)
                    work.append((other, iter(sorted(edges[other]))))
                    break
                if other in on:
                    low[node] = min(low[node], index[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    part = []
                    while True:
                        part.append(stack.pop())
                        on.discard(part[-1])
                        if part[-1] == node:
                            break
                    if len(part) > 1:
                        out.append(sorted(part))
    return out


def roots():
    """The root files of all packages: libraries and programs."""
    for folder, folders, files in os.walk("."):
        folders[:] = sorted(name for name in folders if name not in SKIPPED)
        if "Cargo.toml" not in files:
            continue
        with open(os.path.join(folder, "Cargo.toml"), "rb") as manifest:
            manifest = tomllib.load(manifest)
        if "package" not in manifest:
            continue
        named = [manifest.get("lib", {}).get("path", "src/lib.rs")]
        named += [it["path"] for it in manifest.get("bin", []) if "path" in it] + ["src/main.rs"]
        for path in dict.fromkeys(os.path.normpath(os.path.join(folder, name)) for name in named):
            if os.path.exists(path):
                yield path


def allowed():
    """The circles that may stay."""
    if not os.path.exists(ALLOW):
        return set()
    with open(ALLOW, encoding="utf-8") as lines:
        lines = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    without = [line for line in lines if " # " not in line]
    if without:
        sys.exit(f"{ALLOW}: no reason for: {without[0]}")
    return {line.partition(" # ")[0].strip() for line in lines}


def main():
    files, known, found = 0, allowed(), []
    for root in roots():
        crate = Crate(root)
        files += len(crate.modules)
        edges = {file.path: crate.needs(file) for file in crate.modules.values()}
        folders = {file.path: os.path.dirname(file.path) for file in crate.modules.values()}
        # The file `a.rs` of a module with a folder `a/` belongs to that folder.
        for file in crate.modules.values():
            if any(other.module[:-1] == file.module and other is not file for other in crate.modules.values()):
                folders[file.path] = file.folder
        for circle in circles(edges):
            if len({folders[path] for path in circle}) > 1:
                found.append((circle, edges))
    names = {" ".join(circle) for circle, _ in found}
    new = [(circle, edges) for circle, edges in found if " ".join(circle) not in known]
    for circle, edges in new:
        print(" ".join(circle))
        if "--edges" in sys.argv[1:]:
            for path in circle:
                print(f"    {path} -> {' '.join(sorted(edges[path] & set(circle)))}")
    for gone in sorted(known - names):
        print(f"{ALLOW}: this circle is no longer there: {gone}")
    print(f"{files} files, {len(new)} new circles between folders, {len(names & known)} allowed")
    sys.exit(1 if new or known - names else 0)


if __name__ == "__main__":
    main()
