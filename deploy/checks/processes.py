"""Services of compose/compose.yaml as processes of this machine: see ../try-compose."""

import os
import re
import secrets
import shutil
import signal
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path

import yaml

DEPLOY = Path(__file__).resolve().parents[1]


def interpolated(text, variables):
    """`${NAME:?…}` and `${NAME:-default}`, defaults in defaults as well."""
    while True:
        found = re.search(r"\$\{(\w+)(?::([-?])([^${}]*))?\}", text)
        if not found:
            return text
        name, kind, rest = found.groups()
        value = variables.get(name) or (rest if kind == "-" else None)
        if value is None:
            raise SystemExit(f"compose.yaml: {name} is not set")
        text = text[: found.start()] + value + text[found.end() :]


class Services:
    """The services of the file, as processes."""

    def __init__(self, program, folder):
        variables = {
            "YOTO_DB_PASSWORD": secrets.token_hex(12),
            "YOTO_S3_KEY": "yoto" + secrets.token_hex(6),
            "YOTO_S3_SECRET": secrets.token_hex(16),
        }
        text = (DEPLOY / "compose" / "compose.yaml").read_text(encoding="utf-8")
        # Comments show variables that are not set.
        text = "\n".join(it for it in text.splitlines() if not it.lstrip().startswith("#"))
        self.services = yaml.safe_load(interpolated(text, variables))["services"]
        self.folder, self.running = folder, {}
        # A copy: a build that goes on meanwhile replaces the file, and workers start themselves again to read uploads.
        self.program = shutil.copy2(program, folder / "yoto")
        net = f"127.{secrets.randbelow(200) + 20}.{secrets.randbelow(250)}"
        self.address = {name: f"{net}.{number}" for number, name in enumerate(self.services, 1)}

    def local(self, text, own):
        """The text with addresses in place of names of services, and `own` in place of all interfaces."""
        for name, address in self.address.items():
            text = re.sub(rf"(?:(?<=//)|(?<=[@= ])){re.escape(name)}(?=:\d|$)", address, text)
        return text.replace("0.0.0.0", own)

    def start(self, name, command, environment=None, number=""):
        """Starts a process whose output goes to a file."""
        label = f"{name}{number}"
        own = self.folder / label
        own.mkdir(exist_ok=True)
        with open(self.folder / f"{label}.log", "ab") as log:
            process = subprocess.Popen(
                command, env={"PATH": os.environ["PATH"], "HOME": str(own), "TMPDIR": str(own), **(environment or {})},
                cwd=own, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
            )
        self.running[label] = process
        return process

    def service(self, name, program, number=""):
        """Starts a service by its `command`, with its folders below its own one."""
        service, own = self.services[name], self.folder / f"{name}{number}"
        paths = {"/var/lib/yoto": str(own), "=/data": f"={own}"}
        words = [self.local(it, self.address[name]) for it in service["command"]]
        for old, new in paths.items():
            words = [it.replace(old, new) for it in words]
        environment = {key: self.local(value or "", self.address[name]) for key, value in service.get("environment", {}).items()}
        return self.start(name, [program, *words], environment, number)

    def log(self, label):
        """The end of a service's log."""
        return "\n".join((self.folder / f"{label}.log").read_text(errors="replace").splitlines()[-12:])

    def until(self, label, what, check, seconds=90):
        """Waits for a check; ends with the log if the process is gone."""
        limit = time.monotonic() + seconds
        while not check():
            process = self.running.get(label)
            if process is not None and process.poll() is not None:
                raise SystemExit(f"try-compose: {label} ended with {process.returncode}:\n{self.log(label)}")
            if time.monotonic() > limit:
                raise SystemExit(f"try-compose: {label}: {what} not within {seconds} s:\n{self.log(label)}")
            time.sleep(0.3)

    def stop(self):
        """SIGTERM to all that run, then the end."""
        for process in reversed(list(self.running.values())):
            if process.poll() is None:
                process.terminate()
        limit = time.monotonic() + 60
        for label, process in self.running.items():
            try:
                process.wait(max(0.1, limit - time.monotonic()))
            except subprocess.TimeoutExpired:
                print(f"try-compose: {label} does not end by SIGTERM within a minute", file=sys.stderr)
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def answers(url):
    """Whether a page answers 200."""
    try:
        with urllib.request.urlopen(url, timeout=3) as answer:
            return answer.status == 200
    except (urllib.error.URLError, OSError, ValueError):
        return False
