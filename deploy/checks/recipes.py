"""What files say in two places, or must never say: recipes.py"""

import json
import re
import sys
from pathlib import Path

import yaml

DEPLOY = Path(__file__).resolve().parents[1]
ROOT = DEPLOY.parent
# With these a worker confines the child that reads uploads; older systemd has them in no group of `@system-service`.
CONFINING_CALLS = ["landlock_create_ruleset", "landlock_add_rule", "landlock_restrict_self", "seccomp"]
failures = []


def must(condition, text):
    """Notes a failure unless the condition holds."""
    if not condition:
        failures.append(text)


def seconds(text):
    """A duration of Compose."""
    return int(re.fullmatch(r"(\d+)s", text).group(1))


def containerfile():
    """One Rust, no root at the end, a health check in the form that needs no shell, licences and bill of materials."""
    text = (DEPLOY / "Containerfile").read_text(encoding="utf-8")
    toolchain = re.search(r'channel = "(.+)"', (ROOT / "rust-toolchain.toml").read_text(encoding="utf-8")).group(1)
    rust = re.search(r"^ARG RUST=(\S+)", text, re.M).group(1)
    must(rust == toolchain, f"Containerfile: Rust {rust}, and {toolchain} in rust-toolchain.toml")
    last = text[text.rindex("\nFROM ") :]
    user = re.findall(r"^USER (\S+)", last, re.M)
    must(user and re.fullmatch(r"[1-9]\d*(:[1-9]\d*)?", user[-1]), f"Containerfile: the last user is {user or 'root'}, not a number")
    must(re.search(r"^HEALTHCHECK .*\bCMD \[", last, re.M | re.S), "Containerfile: no HEALTHCHECK without a shell")
    for name in ("THIRD-PARTY-LICENSES.txt", "yoto.cdx.json"):
        must(f"--out /out/{name}" in text and f"/out/{name} " in last, f"Containerfile: {name} is not in the image")
    debian = {"bookworm": "12", "trixie": "13"}[re.search(r"^ARG DEBIAN=(\S+)", text, re.M).group(1)]
    must(f"distroless/cc-debian{debian}:" in text, "Containerfile: the images of build and run are not of the same Debian")
    workspace = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    members = re.findall(r'"([^"]+)"', re.search(r"members = \[(.*?)\]", workspace, re.S).group(1))
    kept = {it[1:] for it in (ROOT / ".dockerignore").read_text(encoding="utf-8").split() if it.startswith("!")}
    for script in re.findall(r"python3 (deploy/\S+)", text):
        must(script in kept, f".dockerignore leaves out {script}, which the build runs")
    for member in members:
        must(member.split("/")[0] in kept, f".dockerignore leaves out {member}, a member of the workspace")


def compose():
    """No secret in the file, no port beyond this machine, fixed images, and time to stop."""
    file = yaml.safe_load((DEPLOY / "compose" / "compose.yaml").read_text(encoding="utf-8"))
    services = file["services"]
    for name, service in services.items():
        for variable, value in service.get("environment", {}).items():
            if variable == "YOTO_KEY":
                must(re.fullmatch(r"\$\{\w+:-\}", value), f"compose.yaml: {name}: {variable} is written out, or needed where no key is asked for")
            elif re.search("PASSWORD|SECRET|KEY", variable):
                must(re.fullmatch(r"\$\{\w+:\?.+\}", value), f"compose.yaml: {name}: {variable} is written out, or may be empty")
        must(re.search(r":[^:/]*[\d}]", service["image"]), f"compose.yaml: {name}: the image {service['image']} has no version")
        for port in service.get("ports", []):
            must(port.startswith("127.0.0.1:"), f"compose.yaml: {name}: port {port} is open to other machines")
        own = "coordinator" in name or name in ("worker", "balancer")
        must(not own or service.get("read_only") is True, f"compose.yaml: {name}: its root file system can be written to")
        must("no-new-privileges:true" in service.get("security_opt", []), f"compose.yaml: {name}: it may gain privileges")
        for word in service.get("command", []):
            if word.startswith("--drain-seconds="):
                needed = int(word.split("=")[1]) + 35
                must(seconds(service["stop_grace_period"]) > needed, f"compose.yaml: {name}: it is killed before it has drained")
    worker = services["worker"]
    notice = next(int(it.split("=")[1]) for it in worker["command"] if it.startswith("--notice="))
    must(seconds(worker["stop_grace_period"]) > notice, "compose.yaml: worker: it is killed before its notice is over")
    coordinators = {it for it in services if it.startswith("coordinator")}
    service = next(it for it in worker["command"] if it.startswith("--service="))
    named = set(re.findall(r"http://([\w-]+):", service))
    must(named == coordinators, f"compose.yaml: worker: it knows {sorted(named)}, and there are {sorted(coordinators)}")
    balancer = (DEPLOY / "compose" / "haproxy.cfg").read_text(encoding="utf-8")
    named = set(re.findall(r"^\s+server \S+ ([\w-]+):", balancer, re.M))
    must(named == coordinators, f"haproxy.cfg: it knows {sorted(named)}, and there are {sorted(coordinators)}")


def units():
    """Time to stop, files for one user, and the same protections in each but for the system calls that a worker's child is confined with."""
    protections = {}
    for file in sorted((DEPLOY / "systemd").glob("*.service")):
        text = file.read_text(encoding="utf-8")
        lines = dict(it.split("=", 1) for it in text.splitlines() if "=" in it and not it.startswith("#"))
        must(lines.get("UMask") == "0077", f"{file.name}: UMask is not 0077")
        must("MemoryMax" in lines, f"{file.name}: no MemoryMax")
        notice = re.search(r"--notice (\d+)", text)
        drain = re.search(r"--drain-seconds (\d+)", text)
        must(not drain or int(lines["TimeoutStopSec"]) > int(drain.group(1)) + 35, f"{file.name}: it is killed before it has drained")
        must(not notice or int(lines["TimeoutStopSec"]) > int(notice.group(1)), f"{file.name}: it is killed before its notice is over")
        words = ("Protect", "Restrict", "SystemCall", "NoNew", "Private", "Lock", "RemoveIPC", "Capability")
        protections[file.name] = {key: value for key, value in lines.items() if key.startswith(words)}
        works = "--no-worker" not in lines["ExecStart"]
        calls = ["@system-service", *(CONFINING_CALLS if works else [])]
        named = protections[file.name].pop("SystemCallFilter", "").split()
        must(named == calls, f"{file.name}: its system calls are {named}, and should be {calls}")
    first = next(iter(protections.values()))
    for name, those in protections.items():
        must(those == first, f"{name}: its protections differ from those of {next(iter(protections))}")


def slurm():
    """The signal comes before the time is up, and leaves the worker its notice."""
    text = (DEPLOY / "slurm" / "yoto-workers.sbatch").read_text(encoding="utf-8")
    signal = int(re.search(r"^#SBATCH --signal=B:TERM@(\d+)", text, re.M).group(1))
    notice = int(re.search(r"YOTO_NOTICE:-(\d+)", text).group(1))
    must(signal > notice, f"yoto-workers.sbatch: SIGTERM {signal} s before the end, and a notice of {notice} s")
    must(re.search(r"^exec ", text, re.M), "yoto-workers.sbatch: the worker is not the script's process, so SIGTERM does not reach it")


def chart():
    """The version of the chart's program is the project's."""
    file = yaml.safe_load((DEPLOY / "chart" / "Chart.yaml").read_text(encoding="utf-8"))
    version = re.search(r'^version = "(.+)"', (ROOT / "Cargo.toml").read_text(encoding="utf-8"), re.M).group(1)
    must(file["appVersion"] == version, f"Chart.yaml: appVersion {file['appVersion']}, and the project is {version}")
    schema = json.loads((DEPLOY / "chart" / "values.schema.json").read_text(encoding="utf-8"))
    values = yaml.safe_load((DEPLOY / "chart" / "values.yaml").read_text(encoding="utf-8"))
    unknown = set(values) - set(schema["properties"])
    must(not unknown, f"values.schema.json lacks {sorted(unknown)}")


for check in (containerfile, compose, units, slurm, chart):
    check()
for failure in failures:
    print(failure, file=sys.stderr)
sys.exit(1 if failures else 0)
