"""Runs the queries of the chart's ScaledJobs on a database with the project's tables and compares the counts with what is queued.

    keda_query.py HELM

Each step below changes rows and says how many pods each pool then needs.
"""

import sys
from pathlib import Path

import postgres
from chart import render

MIGRATIONS = Path(__file__).resolve().parents[2] / "migrations" / "postgres"
POOLS = {
    "workers": [
        {"name": "light", "kinds": ["ingest", "render", "evaluate", "export"], "maxReplicas": 9},
        {"name": "train", "kinds": ["train"], "maxReplicas": 9},
    ]
}

TENANT = "INSERT INTO subjects (id, display_name, consent_note, create_time, tenant) VALUES ('s', 's', '', 0, 'default');"


def model(name):
    """A model."""
    return f"INSERT INTO models (id, display_name, tier, variant, create_time, tenant) VALUES ('{name}', '', 'splat', '', 0, 'default');"


def worker(name, pod):
    """A worker with the display name `pod`."""
    return (
        "INSERT INTO workers (id, display_name, backend, adapter, gpu, memory_bytes, create_time, tenant)"
        f" VALUES ('{name}', '{pod}', '', '', 0, 0, 0, 'default');"
    )


def queued(name, kind, of="m1", more=""):
    """A job that waits."""
    column, value = ("capture", of) if kind == "ingest" else ("model", of)
    return (
        f"INSERT INTO jobs (id, kind, {column}, spec, create_time, tenant) VALUES ('{name}', '{kind}', '{value}', '', 0, 'default');"
        + (f"UPDATE jobs SET {more} WHERE id = '{name}';" if more else "")
    )


def leased(name, by):
    """The job runs on a worker."""
    return f"UPDATE jobs SET state = 'RUNNING', worker = '{by}', lease_deadline = 1e12, lease = 1 WHERE id = '{name}';"


def ended(name):
    """The job is over."""
    return f"UPDATE jobs SET state = 'SUCCEEDED', lease_deadline = NULL, end_time = 1 WHERE id = '{name}';"


# What happens, the statements, and the pods that the pools light and train then need.
STEPS = [
    ("nothing is queued", TENANT + model("m1") + model("m2"), 0, 0),
    ("a render and an export wait", queued("r1", "render") + queued("e1", "export"), 2, 0),
    (
        "an upload waits",
        "INSERT INTO captures (id, subject, create_time, idle_since) VALUES ('c1', 's', 0, 0);" + queued("i1", "ingest", "c1"),
        3, 0,
    ),
    ("two trainings of one model wait: one of them can run", queued("t1", "train") + queued("t2", "train"), 3, 1),
    ("a training of another model waits", queued("t3", "train", "m2"), 3, 2),
    ("a pod of the chart takes a render", worker("w1", "prod-yoto-light-x7k2p-abcde") + leased("r1", "w1"), 3, 2),
    ("a pod takes a training; the other of its model waits for it", worker("w2", "prod-yoto-train-9zz4q-fghij") + leased("t1", "w2"), 3, 2),
    ("a worker of another engine takes the export", worker("w3", "slurm-4711") + leased("e1", "w3"), 2, 2),
    (
        "a second pod helps with the render",
        worker("w4", "prod-yoto-light-aaaaa-bbbbb")
        + "INSERT INTO job_attempts (job, lease, worker, begin_time, lease_deadline) VALUES ('r1', 2, 'w4', 0, 1e12);",
        3, 2,
    ),
    ("a pool whose name begins alike has its own pods", worker("w5", "prod-yoto-lighter-x") + queued("v1", "evaluate") + leased("v1", "w5"), 3, 2),
    ("a postponed job waits for its time", queued("r2", "render", more="not_before = extract(epoch FROM now()) + 600"), 3, 2),
    ("its time has come", "UPDATE jobs SET not_before = extract(epoch FROM now()) - 1 WHERE id = 'r2';", 4, 2),
    ("renders are paused", "INSERT INTO paused_kinds VALUES ('default', 'render', '', 0);", 3, 2),
    ("another tenant's pause is not this one's", "UPDATE paused_kinds SET tenant = 'other';", 4, 2),
    ("the service is drained: pods that work go on", "INSERT INTO drains VALUES (1, '', 0);", 2, 1),
    ("the drain ends", "DELETE FROM drains;", 4, 2),
    ("the training ends: the other of its model can run", ended("t1"), 4, 2),
    ("it is cancelled", "UPDATE jobs SET state = 'CANCELLED', end_time = 1 WHERE id = 't2';", 4, 1),
    ("render and helper end", ended("r1") + "UPDATE job_attempts SET lease_deadline = NULL, end_time = 1, outcome = 'HELPED';", 2, 1),
]


def queries(helm):
    """The chart's query of each pool."""
    found = {}
    for item in render(helm, POOLS):
        if item["kind"] == "ScaledJob":
            found[item["metadata"]["name"].rsplit("-", 1)[1]] = item["spec"]["triggers"][0]["metadata"]["query"]
    return found


def main():
    texts = queries(sys.argv[1])
    failures = []
    with postgres.running() as folder:
        for file in sorted(MIGRATIONS.glob("*.sql")):
            postgres.psql(folder, file.read_text(encoding="utf-8"))
        # KEDA's role, as docs/operate/deploying.md makes it.
        postgres.psql(folder, "CREATE ROLE keda LOGIN; GRANT SELECT ON jobs, leases, workers, paused_kinds, drains TO keda;")
        for what, statements, light, train in STEPS:
            postgres.psql(folder, statements)
            for pool, wanted in (("light", light), ("train", train)):
                got = postgres.psql(folder, texts[pool], name="keda")
                if got != str(wanted):
                    failures.append(f"{what}: the pool {pool} needs {wanted} pods, the query says {got}")
    for failure in failures:
        print(failure, file=sys.stderr)
    if not failures:
        print(f"{len(STEPS)} states of the queue, {len(texts)} pools")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
