"""A private PostgreSQL of Debian's programs, in a temporary folder."""

import contextlib
import os
import pwd
import shutil
import subprocess
import tempfile
import time
from pathlib import Path


def programs():
    """The folder of the newest version's programs, or None."""
    versions = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda it: int(it.parts[4]))
    if versions:
        return versions[-1].parent
    found = shutil.which("initdb")
    return Path(found).resolve().parent if found else None


def user():
    """Options for a process that PostgreSQL accepts: root is refused."""
    if os.geteuid() != 0:
        return {}
    names = {it.pw_name for it in pwd.getpwall()}
    name = "postgres" if "postgres" in names else "nobody"
    entry = pwd.getpwnam(name)
    return {"user": entry.pw_uid, "group": entry.pw_gid, "extra_groups": []}


@contextlib.contextmanager
def running(listen="", port=5432, password=None, name="postgres", options=()):
    """Runs a server until the block ends; gives the folder of its socket. `listen` is an address, and `name` its superuser."""
    folder = Path(tempfile.mkdtemp(prefix="yoto-pg-"))
    who, bin_folder = user(), programs()
    if who:
        os.chown(folder, who["user"], who["group"])
    secret = folder / "password"
    secret.write_text(password or "unused", encoding="utf-8")
    secret.chmod(0o600)
    if who:
        os.chown(secret, who["user"], who["group"])
    method = ["--auth-local=trust", f"--auth-host={'scram-sha-256' if password else 'trust'}"]
    data = folder / "data"
    server = None
    try:
        subprocess.run(
            [bin_folder / "initdb", "-D", data, "-U", name, "-E", "UTF8", "--no-locale", "-N", f"--pwfile={secret}", *method],
            check=True, stdout=subprocess.DEVNULL, cwd=folder, **who,
        )
        with open(folder / "log", "wb") as log:
            server = subprocess.Popen(
                [bin_folder / "postgres", "-D", data, "-k", folder, "-p", str(port), "-c", f"listen_addresses={listen}", *options],
                stdout=log, stderr=log, stdin=subprocess.DEVNULL, cwd=folder, start_new_session=True, **who,
            )
        for _ in range(600):
            ready = subprocess.run([bin_folder / "pg_isready", "-q", "-h", folder, "-p", str(port)], check=False)
            if ready.returncode == 0:
                break
            if server.poll() is not None:
                raise RuntimeError(f"PostgreSQL ended: {(folder / 'log').read_text(errors='replace')[-2000:]}")
            time.sleep(0.1)
        else:
            raise RuntimeError("PostgreSQL does not answer after a minute")
        yield folder
    finally:
        if server and server.poll() is None:
            server.send_signal(2)  # a fast shutdown
            try:
                server.wait(30)
            except subprocess.TimeoutExpired:
                server.kill()
        shutil.rmtree(folder, ignore_errors=True)


def psql(folder, statements, database="postgres", name="postgres", port=5432):
    """What the statements select, a line per row; raises at the first error."""
    done = subprocess.run(
        [programs() / "psql", "-X", "-q", "-t", "-A", "-v", "ON_ERROR_STOP=1", "-h", str(folder), "-p", str(port),
         "-U", name, "-d", database],
        input=statements, capture_output=True, text=True, check=False,
    )
    if done.returncode:
        raise RuntimeError(done.stderr.strip())
    return done.stdout.strip()
