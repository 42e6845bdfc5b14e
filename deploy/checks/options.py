"""Checks that the program knows each option and each variable of its own that a recipe uses: options.py PROGRAM [HELM]"""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import yaml

DEPLOY = Path(__file__).resolve().parents[1]


def compose():
    """Arguments and environment of the services that run the program."""
    file = yaml.safe_load((DEPLOY / "compose" / "compose.yaml").read_text(encoding="utf-8"))
    for name, service in file["services"].items():
        if "YOTO_IMAGE" in service["image"]:
            yield f"compose.yaml, {name}", service["command"], service.get("environment", {})


def chart(helm):
    """The same of the chart's containers."""
    from chart import ACCEPTED, render

    for values in ACCEPTED.values():
        for item in render(helm, values):
            if item["kind"] in ("Deployment", "ScaledJob"):
                spec = item["spec"]
                template = spec["jobTargetRef"]["template"] if item["kind"] == "ScaledJob" else spec["template"]
                for container in template["spec"]["containers"]:
                    variables = [it["name"] for it in container.get("env", [])]
                    yield f"chart, {item['metadata']['name']}", container["args"], variables


def text(file, start):
    """The command of a script or a unit from the words `start` on; lines that end with a backslash go on."""
    whole = (DEPLOY / file).read_text(encoding="utf-8").replace("\\\n", " ")
    line = next(it for it in whole.splitlines() if start in it and not it.lstrip().startswith("#"))
    words = shlex.split(line[line.index(start) + len(start) :])
    return file, words, re.findall(r"\bYOTO_[A-Z_]+\b", whole)


# Variables of recipes that the program never sees.
OURS = {"YOTO_IMAGE", "YOTO_SETTINGS", "YOTO_STORE", "YOTO_LISTEN", "YOTO_NOTICE", "YOTO_MAX_IDLE"}


def recipes(helm):
    """All of them: name, arguments, variables."""
    yield from compose()
    if helm:
        yield from chart(helm)
    yield text("systemd/yoto.service", "/usr/local/bin/yoto ")
    yield text("systemd/yoto-coordinator.service", "/usr/local/bin/yoto ")
    yield text("systemd/yoto-worker@.service", "/usr/local/bin/yoto ")
    yield text("slurm/yoto-workers.sbatch", 'exec "${worker[@]}" ')
    yield text("skypilot/worker.yaml", '"$YOTO_IMAGE" worker'.removesuffix("worker"))
    yield text("dstack/worker.dstack.yml", "exec yoto ")


def known(program, words, texts):
    """The help of a subcommand."""
    if words not in texts:
        done = subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=False)
        texts[words] = done.stdout
    return texts[words]


def unknown(program, found):
    """Sentences about what the program does not know of these recipes, and the number of options."""
    texts, failures, seen = {}, set(), 0
    for name, words, variables in found:
        command = next(it for it in words if not it.startswith("-"))
        before = words[: words.index(command)]
        for word in words:
            if not word.startswith("--"):
                continue
            seen += 1
            option = word.split("=")[0]
            page = known(program, () if word in before else (command,), texts)
            if not re.search(rf"{re.escape(option)}\b", page):
                failures.add(f"{name}: `yoto {command}` does not know {option}")
        for variable in variables:
            own = variable.startswith("YOTO_") and variable not in OURS
            if own and variable not in known(program, (command,), texts):
                failures.add(f"{name}: `yoto {command}` does not read {variable}")
    return sorted(failures), seen


def main():
    failures, seen = unknown(sys.argv[1], recipes(sys.argv[2] if len(sys.argv) > 2 else ""))
    for failure in failures:
        print(failure, file=sys.stderr)
    if not failures:
        print(f"{seen} options")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
