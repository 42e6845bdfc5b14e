#!/usr/bin/env python3
"""Writes the licence texts of everything that is compiled into the `yoto` program.

    deploy/licences.py --target x86_64-unknown-linux-gnu [--features yoto/gpu] --out FILE

Packages come from `cargo tree`, texts from their sources in cargo's registry, including those of
bundled C and C++ libraries. Equal texts are printed once. A package without any text is listed with
its SPDX expression; one with neither is an error.
"""

import argparse
import json
import pathlib
import re
import subprocess
import sys

# Names of licence files, e.g. LICENSE-MIT, COPYING.txt, NOTICE, license.md, LICENCE.
NAMES = re.compile(r"^(licen[sc]e|copying|copyright|notice|unlicense|patents|authors\.)", re.IGNORECASE)
# Files with such names that are no texts, e.g. license.rs.
ENDINGS = {"", ".txt", ".md", ".html", ".apache", ".mit", ".apache2", ".apache-2.0", ".boost", ".zlib", ".bsd"}
# Folders of a package that are not compiled into the program.
SKIPPED = {"tests", "test", "examples", "benches", "fuzz", "target", ".git", ".github", "testdata", "doc", "docs"}
RULE = "=" * 100


def cargo(*arguments):
    """The output of a cargo command in the repository."""
    root = pathlib.Path(__file__).resolve().parent.parent
    done = subprocess.run(["cargo", *arguments], cwd=root, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"licences.py: cargo {arguments[0]} failed:\n{done.stderr}")
    return done.stdout


def tree(target, features):
    """Depth, and (name, version), of each line of the tree of packages that the program is linked from."""
    options = ["--features", features] if features else []
    lines = cargo(
        "tree", "--locked", "-p", "yoto", "-e", "normal", "--target", target,
        "--prefix", "depth", "--format", " {p}", *options,
    )
    for line in lines.splitlines():
        words = line.split()
        if len(words) >= 3:
            yield int(words[0]), (words[1], words[2].removeprefix("v"))


def packages(target, features, own=False):
    """The compiled packages, as `cargo metadata` describes them: those of other people, and with `own` also this repository's."""
    options = ["--features", features] if features else []
    metadata = cargo("metadata", "--locked", "--format-version", "1", "--filter-platform", target, *options)
    wanted = {key for _, key in tree(target, features)}
    found = {}
    for package in json.loads(metadata)["packages"]:
        key = (package["name"], package["version"])
        if key in wanted:
            wanted.discard(key)
            # Packages without a source are those of this repository.
            if own or package["source"] is not None:
                found[key] = package
    if wanted:
        names = ", ".join(f"{name} {version}" for name, version in sorted(wanted))
        sys.exit(f"licences.py: cargo metadata lacks {names}")
    return [found[key] for key in sorted(found)]


def is_text(path):
    if not NAMES.match(path.name):
        return False
    suffix = path.suffix.lower()
    # A name such as LICENSE-2.0 or LICENSE-BSD.3 has no ending.
    return suffix in ENDINGS or suffix[1:].isdigit()


def texts(package):
    """Paths and texts of the licence files in a package's sources."""
    folder = pathlib.Path(package["manifest_path"]).parent
    paths = []
    for path in sorted(folder.rglob("*")):
        below = path.relative_to(folder)
        if SKIPPED.isdisjoint(below.parts[:-1]) and path.is_file() and is_text(path):
            paths.append(path)
    named = package.get("license_file")
    if named and (folder / named).is_file() and folder / named not in paths:
        paths.append(folder / named)
    for path in paths:
        text = path.read_text(encoding="utf-8", errors="replace")
        lines = [line.rstrip() for line in text.splitlines()]
        text = "\n".join(lines).strip("\n")
        if text:
            yield path.relative_to(folder) if path.is_relative_to(folder) else path.name, text


def notices(package):
    """Copyright lines of bundled C and C++ sources."""
    found = set()
    for path in pathlib.Path(package["manifest_path"]).parent.rglob("*"):
        if path.suffix in {".c", ".cc", ".cpp", ".h", ".hpp"} and path.is_file():
            text = path.read_text(encoding="utf-8", errors="replace")
            found.update(re.findall(r"copyright \(c\)[^\n\"]*", text, re.IGNORECASE))
    return sorted(line.strip(" */") for line in found)


def standard_library():
    """Licence texts of Rust's standard library, where the toolchain has them."""
    sysroot = subprocess.run(["rustc", "--print", "sysroot"], capture_output=True, text=True, check=True)
    folder = pathlib.Path(sysroot.stdout.strip()) / "share/doc/rust/licenses"
    for name in ("MIT.txt", "Apache-2.0.txt"):
        if (folder / name).is_file():
            yield name, (folder / name).read_text(encoding="utf-8").strip("\n")


def weights():
    """Licence texts of weights that the program's own sources hold, each beside its file."""
    root = pathlib.Path(__file__).resolve().parent.parent
    for path in sorted(root.glob("worker/*/src/**/LICENSE-*")):
        yield path.relative_to(root), path.read_text(encoding="utf-8").strip("\n")


def collect(listed):
    """Texts with the packages that have each, and the packages without a text."""
    grouped, bare, faults = {}, [], []
    for package in listed:
        label = f"{package['name']} {package['version']}"
        own = list(texts(package))
        for path, text in own:
            grouped.setdefault(text, []).append(f"{label} ({path})")
        if own:
            continue
        if package.get("license"):
            bare.append(package)
        else:
            faults.append(label)
    if faults:
        sys.exit("licences.py: neither a licence text nor an SPDX field: " + ", ".join(faults))
    for name, text in standard_library():
        grouped.setdefault(text, []).append(f"Rust's standard library ({name})")
    for path, text in weights():
        grouped.setdefault(text, []).append(f"weights in yoto ({path})")
    return grouped, bare


def document(listed, target):
    grouped, bare = collect(listed)
    lines = [
        "Licences of the software that is compiled into yoto",
        "",
        f"{len(listed)} packages from crates.io for {target}, and Rust's standard library (MIT OR Apache-2.0,",
        "https://www.rust-lang.org). The sources of a package are at https://crates.io/crates/NAME/VERSION.",
        "",
    ]
    for package in listed:
        licence = package.get("license") or f"see {package['license_file']}"
        lines.append(f"{package['name']} {package['version']}: {licence}")
    if bare:
        lines += [
            "",
            RULE,
            "Packages whose sources contain no licence file. Each is used under the licence that it names. The",
            "standard texts of MIT and Apache-2.0 are in LICENSE-MIT and LICENSE-APACHE beside this file, the",
            "others at https://spdx.org/licenses.",
            "",
        ]
        for package in bare:
            authors = ", ".join(package["authors"]) or "its authors"
            source = package.get("repository") or "https://crates.io/crates/" + package["name"]
            lines.append(f"{package['name']} {package['version']}: {package['license']}, by {authors}, {source}")
            lines += [f"    {notice}" for notice in notices(package)]
    for text, owners in sorted(grouped.items(), key=lambda it: it[1][0]):
        lines += ["", RULE, *owners, RULE, "", text]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description="Writes the licence texts of everything in the yoto program.")
    parser.add_argument("--target", required=True, help="target triple of the program")
    parser.add_argument("--features", default="", help="features that the program is built with")
    parser.add_argument("--out", required=True, type=pathlib.Path)
    options = parser.parse_args()
    listed = packages(options.target, options.features)
    options.out.write_text(document(listed, options.target), encoding="utf-8")
    print(f"{options.out}: licences of {len(listed)} packages", file=sys.stderr)


if __name__ == "__main__":
    main()
