"""Breaks what deploy/check guards, one thing at a time in a copy, and sees that the check fails: breaks.py [NAME …]"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

# Name of the check, file, what is there, what is put in its place.
BREAKS = [
    ("scripts", "deploy/compose/up", 'cd "$(dirname "$0")"', "cd $(dirname $0)"),
    ("yaml", "deploy/skypilot/worker.yaml", "  cpus: 8+", "   cpus: 8+"),
    ("containerfile", "deploy/Containerfile", "python3=3.*", "python3"),
    ("recipes", "deploy/Containerfile", "USER 65532:65532", "USER root"),
    ("recipes", "deploy/Containerfile", "ARG RUST=1", "ARG RUST=0"),
    ("recipes", ".dockerignore", "!migrations\n!proto", "!migrations"),
    ("recipes", "deploy/compose/compose.yaml", "${YOTO_S3_SECRET:?see deploy/compose/up}", "hunter2"),
    ("recipes", "deploy/compose/compose.yaml", '"127.0.0.1:${YOTO_PORT', '"${YOTO_PORT'),
    ("recipes", "deploy/compose/compose.yaml", "stop_grace_period: 75s", "stop_grace_period: 10s"),
    ("recipes", "deploy/compose/compose.yaml", ",http://coordinator-2:50051", ""),
    ("recipes", "deploy/compose/haproxy.cfg", "    server coordinator-2 coordinator-2:50051\n", ""),
    ("recipes", "deploy/systemd/yoto-worker@.service", "TimeoutStopSec=75", "TimeoutStopSec=45"),
    ("recipes", "deploy/systemd/yoto-worker@.service", "ProtectClock=true\n", ""),
    ("recipes", "deploy/slurm/yoto-workers.sbatch", "B:TERM@90", "B:TERM@20"),
    ("recipes", "deploy/slurm/yoto-workers.sbatch", "\nexec ", "\n"),
    ("recipes", "deploy/chart/Chart.yaml", 'appVersion: "0', 'appVersion: "9'),
    ("compose", "deploy/compose/compose.yaml", "    read_only: true", "    readonly: true"),
    ("compose", "deploy/compose/compose.yaml", "condition: service_healthy", "condition: service_happy"),
    ("recipes", "deploy/compose/compose.yaml", "PGPASSWORD: ${YOTO_DB_PASSWORD:?see deploy/compose/up}", "PGPASSWORD: $YOTO_DB_PASSWORD"),
    ("secrets", "deploy/compose/up", "umask 077", "umask 022"),
    ("secrets", ".gitignore", "/deploy/compose/.env*\n", ""),
    ("balancer", "deploy/compose/haproxy.cfg", "proto h2 check", "protocol h2 check"),
    ("systemd", "deploy/systemd/yoto.service", "ProtectClock=", "ProtectClocks="),
    ("systemd", "deploy/systemd/yoto-coordinator.service", "MemoryMax=50%", "MemoryMax=much"),
    ("chart", "deploy/chart/templates/coordinators.yaml", "periodSeconds", "periodSecond"),
    ("chart", "deploy/chart/templates/coordinators.yaml", "replicas: {{ .Values.coordinators.replicas }}", 'replicas: "two"'),
    ("chart", "deploy/chart/templates/workers.yaml", "pollingInterval:", "pollInterval:"),
    ("chart", "deploy/chart/templates/workers.yaml", "backoffLimit: 0", "backoffLimits: 0"),
    ("chart", "deploy/chart/templates/workers.yaml", "strategy: gradual", "strategy: immediate"),
    ("chart", "deploy/chart/templates/workers.yaml", "if hasKey $owner $kind", "if false"),
    ("chart", "deploy/chart/templates/_worker.tpl", "$defaults.noticeSeconds 15", "$defaults.noticeSeconds 0"),
    ("chart", "deploy/chart/templates/_helpers.tpl", "readOnlyRootFilesystem: true", "readOnlyRootFilesystem: false"),
    ("chart", "deploy/chart/values.schema.json", '"additionalProperties": false,\n  "required": ["image"', '"required": ["image"'),
    ("queue", "deploy/chart/templates/_queue.tpl", "WHEN q.kind = 'train' THEN q.model ELSE", "WHEN FALSE THEN q.model ELSE"),
    ("queue", "deploy/chart/templates/_queue.tpl", "     AND NOT EXISTS (SELECT 1 FROM paused_kinds", "     AND EXISTS (SELECT 1 FROM jobs p WHERE FALSE) = (1 = 0) AND NOT EXISTS (SELECT 1 FROM (SELECT '' AS tenant, '' AS kind)"),
    ("queue", "deploy/chart/templates/_queue.tpl", "p.tenant = q.tenant AND ", ""),
    ("queue", "deploy/chart/templates/_queue.tpl", "q.not_before <= extract", "TRUE OR q.not_before <= extract"),
    ("queue", "deploy/chart/templates/_queue.tpl", "AND r.state = 'RUNNING'", "AND r.state = 'FAILED'"),
    ("queue", "deploy/chart/templates/_queue.tpl", "'{{ .name }}-'", "'{{ .name }}'"),
    ("queue", "deploy/chart/templates/_queue.tpl", "FROM leases l", "FROM (SELECT worker FROM jobs WHERE state = 'RUNNING') l"),
    ("dstack", "deploy/dstack/worker.dstack.yml", "spot_policy: auto", "spot_policy: always"),
    ("dstack", "deploy/dstack/worker.dstack.yml", "stop_duration: 90s", "stop_duration: 30s"),
    ("skypilot", "deploy/skypilot/worker.yaml", "use_spot: true", "use_spots: true"),
]


def copied(folder):
    """The files that git knows or would add, as a repository of its own."""
    names = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", "deploy", ".ci", "migrations", ".dockerignore",
         ".gitignore", "Cargo.toml", "rust-toolchain.toml"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.split()
    for name in names:
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    subprocess.run(["git", "init", "--quiet"], cwd=folder, check=True)


def main():
    chosen, unseen, tried = sys.argv[1:], 0, 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        copied(folder)
        for check, file, old, new in BREAKS:
            if chosen and check not in chosen:
                continue
            path = folder / file
            text = path.read_text(encoding="utf-8")
            if old not in text:
                print(f"{check}: {file} does not contain {old!r}", file=sys.stderr)
                unseen += 1
                continue
            path.write_text(text.replace(old, new, 1), encoding="utf-8")
            done = subprocess.run(
                [folder / "deploy/check", check],
                capture_output=True,
                text=True,
                check=False,
                env=os.environ | {"YOTO_DEPLOY_ENGINES": "1"},
            )
            path.write_text(text, encoding="utf-8")
            tried += 1
            if f"FAILED   {check}" not in done.stdout:
                print(f"{check}: not seen: {file}: {new.strip()!r} in place of {old.strip()!r}\n{done.stdout}", file=sys.stderr)
                unseen += 1
    print(f"{tried} breaks, {unseen} not seen")
    return 1 if unseen else 0


if __name__ == "__main__":
    sys.exit(main())
