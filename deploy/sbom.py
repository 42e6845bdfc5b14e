#!/usr/bin/env python3
"""Writes the bill of materials of the `yoto` program in CycloneDX 1.6.

    deploy/sbom.py --target x86_64-unknown-linux-gnu [--features yoto/gpu] --out FILE

It lists the packages that the program is linked from, as deploy/licences.py does, with the SHA-256 of Cargo.lock, and
which of them uses which. The same sources give the same bytes: there is no time in it.
"""

import argparse
import hashlib
import json
import pathlib
import re
import sys
import tomllib
import uuid

# No folder of compiled modules beside the scripts.
sys.dont_write_bytecode = True
import licences  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent


def checksums():
    """SHA-256 of each package's archive at crates.io, by name and version."""
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))
    return {(it["name"], it["version"]): it["checksum"] for it in lock["package"] if "checksum" in it}


def expression(package):
    """The licence as SPDX has it, or the name of its file. Cargo also takes the older form with a slash."""
    licence = package.get("license")
    if licence:
        return {"expression": re.sub(r"\s*/\s*", " OR ", licence)}
    return {"license": {"name": f"see {package['license_file']} in the package"}}


def reference(name, version, is_public):
    """The name of a component in the document: its address where it is at crates.io."""
    # A version may have a plus, which an address has to spell.
    return f"pkg:cargo/{name}@{version.replace('+', '%2B')}" if is_public else f"{name}@{version}"


def component(package, sums):
    """A package as the document has it."""
    key = (package["name"], package["version"])
    is_public = package["source"] is not None
    made = {
        "type": "library",
        "bom-ref": reference(*key, is_public),
        "name": package["name"],
        "version": package["version"],
        "licenses": [expression(package)],
    }
    if is_public:
        made["purl"] = made["bom-ref"]
        made["hashes"] = [{"alg": "SHA-256", "content": sums[key]}]
    return made


def uses(target, features):
    """What each compiled package uses, by name and version."""
    found, path = {}, []
    for depth, key in licences.tree(target, features):
        found.setdefault(key, set())
        del path[depth:]
        if path:
            found[path[-1]].add(key)
        path.append(key)
    return found


def document(target, features):
    """The bill of materials."""
    sums = checksums()
    listed = licences.packages(target, features, own=True)
    made = {(it["name"], it["version"]): component(it, sums) for it in listed}
    program = next(it for key, it in made.items() if key[0] == "yoto")
    program["type"] = "application"
    graph = [
        {"ref": made[key]["bom-ref"], "dependsOn": sorted(made[it]["bom-ref"] for it in used)}
        for key, used in sorted(uses(target, features).items())
    ]
    bill = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": program,
            "properties": [{"name": "yoto:target", "value": target}, {"name": "yoto:features", "value": features or "default"}],
        },
        "components": [it for it in made.values() if it is not program],
        "dependencies": graph,
    }
    digest = hashlib.sha256(json.dumps(bill, sort_keys=True).encode()).digest()
    return {**bill, "serialNumber": f"urn:uuid:{uuid.UUID(bytes=digest[:16], version=5)}"}


def main():
    parser = argparse.ArgumentParser(description="Writes the bill of materials of the yoto program.")
    parser.add_argument("--target", required=True, help="target triple of the program")
    parser.add_argument("--features", default="", help="features that the program is built with")
    parser.add_argument("--out", required=True, type=pathlib.Path)
    options = parser.parse_args()
    bill = document(options.target, options.features)
    options.out.write_text(json.dumps(bill, indent=1) + "\n", encoding="utf-8")
    print(f"{options.out}: {len(bill['components'])} components", file=sys.stderr)


if __name__ == "__main__":
    main()
