"""Whether the bill of materials is one of CycloneDX, and lists what `cargo tree` does: sbom.py [FILE]

Without a file, deploy/sbom.py makes one for this machine. The schema is that of cyclonedx-python-lib.
"""

import json
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from cyclonedx.schema import SchemaVersion
from cyclonedx.spdx import is_expression
from cyclonedx.validation.json import JsonStrictValidator

DEPLOY = Path(__file__).resolve().parents[1]
ROOT = DEPLOY.parent


def run(*command):
    """The output of a command in the repository."""
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def made(target):
    """The bill for `target`."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sbom.json"
        run(sys.executable, str(DEPLOY / "sbom.py"), "--target", target, "--out", str(file))
        return file.read_text(encoding="utf-8")


def linked(target, features):
    """Names and versions of what the program is linked from."""
    options = [] if features == "default" else ["--features", features]
    tree = run("cargo", "tree", "--locked", "-p", "yoto", "-e", "normal", "--target", target, "--prefix", "none", *options)
    return set(re.findall(r"^(\S+) v(\S+)", tree, re.M))


def faults(text):
    """What is wrong with a bill, line by line."""
    error = JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)
    if error:
        return [f"not CycloneDX 1.6: {error.data.message} at {error.data.json_path}"]
    bill = json.loads(text)
    about = {it["name"]: it["value"] for it in bill["metadata"]["properties"]}
    listed = [*bill["components"], bill["metadata"]["component"]]
    names = [(it["name"], it["version"]) for it in listed]
    wanted = linked(about["yoto:target"], about["yoto:features"])
    found = [f"{name} {version} is linked and not listed" for name, version in sorted(wanted - set(names))]
    found += [f"{name} {version} is listed and not linked" for name, version in sorted(set(names) - wanted)]
    found += [f"{name} {version} is listed twice" for name, version in sorted(set(names)) if names.count((name, version)) > 1]
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))
    sums = {(it["name"], it["version"]): it.get("checksum") for it in lock["package"]}
    for it in listed:
        key, label = (it["name"], it["version"]), f"{it['name']} {it['version']}"
        own = [hash["content"] for hash in it.get("hashes", [])]
        if own != [sum for sum in [sums.get(key)] if sum]:
            found.append(f"{label}: its SHA-256 is not that of Cargo.lock")
        if bool(own) != (it.get("purl") == f"pkg:cargo/{key[0]}@{key[1].replace('+', '%2B')}"):
            found.append(f"{label}: its address is {it.get('purl')}")
        licences = it.get("licenses", [])
        if not licences or not all(is_expression(it["expression"]) for it in licences if "expression" in it):
            found.append(f"{label}: its licence is {licences}, and none of SPDX")
    known = {it["bom-ref"] for it in listed}
    graph = {it["ref"]: it["dependsOn"] for it in bill["dependencies"]}
    used = {bill["metadata"]["component"]["bom-ref"], *(it for those in graph.values() for it in those)}
    found += [f"{it}: nothing uses it" for it in sorted(known - used)]
    found += [f"{it}: used, and no component" for it in sorted((used | set(graph)) - known)]
    return found


def main():
    if len(sys.argv) > 1:
        text = Path(sys.argv[1]).read_text(encoding="utf-8")
    else:
        text = made(run("rustc", "--print", "host-tuple").strip())
    found = faults(text)
    print("\n".join(found) if found else f"{len(json.loads(text)['components'])} components")
    return 1 if found else 0


sys.exit(main())
