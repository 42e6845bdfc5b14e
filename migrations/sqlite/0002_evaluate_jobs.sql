-- Jobs and workers learn the kind 'evaluate'. SQLite can't alter a CHECK, so both tables are
-- made anew, in the order of https://sqlite.org/lang_altertable.html#otheralter: foreign keys
-- are off meanwhile. They can be switched outside of a transaction only, so this script runs
-- without one around it and brings its own; run twice, it changes nothing more.
PRAGMA foreign_keys = OFF;
BEGIN IMMEDIATE;

CREATE TABLE worker_kinds_2 (
    worker TEXT NOT NULL REFERENCES workers (id) ON DELETE CASCADE,
    kind   TEXT NOT NULL CHECK (kind IN ('ingest', 'train', 'render', 'evaluate')),
    PRIMARY KEY (worker, kind)
) STRICT, WITHOUT ROWID;
INSERT INTO worker_kinds_2 SELECT worker, kind FROM worker_kinds;
DROP TABLE worker_kinds;
ALTER TABLE worker_kinds_2 RENAME TO worker_kinds;

CREATE TABLE jobs_2 (
    ord              INTEGER PRIMARY KEY AUTOINCREMENT,
    id               TEXT NOT NULL UNIQUE,
    kind             TEXT NOT NULL CHECK (kind IN ('ingest', 'train', 'render', 'evaluate')),
    capture          TEXT REFERENCES captures (id),
    model            TEXT REFERENCES models (id),
    state            TEXT NOT NULL DEFAULT 'QUEUED'
                     CHECK (state IN ('QUEUED', 'RUNNING', 'SUCCEEDED', 'FAILED', 'CANCELLED')),
    spec             BLOB NOT NULL,
    progress         BLOB,
    result           BLOB,
    error            BLOB,
    lease            INTEGER NOT NULL DEFAULT 0,
    lease_deadline   REAL,
    lost_workers     INTEGER NOT NULL DEFAULT 0,
    cancel_requested INTEGER NOT NULL DEFAULT 0 CHECK (cancel_requested IN (0, 1)),
    worker           TEXT REFERENCES workers (id),
    sequence         INTEGER NOT NULL DEFAULT 1,
    create_time      REAL NOT NULL DEFAULT (unixepoch('subsec')),
    start_time       REAL,
    end_time         REAL,
    CHECK ((state = 'RUNNING') = (lease_deadline IS NOT NULL)),
    CHECK ((state IN ('SUCCEEDED', 'FAILED', 'CANCELLED')) = (end_time IS NOT NULL)),
    CHECK ((kind = 'ingest') = (capture IS NOT NULL)),
    CHECK ((kind = 'ingest') = (model IS NULL))
) STRICT;
INSERT INTO jobs_2 SELECT * FROM jobs;
DROP TABLE jobs;
ALTER TABLE jobs_2 RENAME TO jobs;
CREATE INDEX jobs_by_state ON jobs (state, ord);
CREATE UNIQUE INDEX one_ingest_a_capture ON jobs (capture);
CREATE UNIQUE INDEX one_trainer_a_model ON jobs (model) WHERE kind = 'train' AND state = 'RUNNING';

COMMIT;
PRAGMA foreign_keys = ON;
