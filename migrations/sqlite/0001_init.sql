-- The catalogue and the job queue. Times are unix seconds of this database's clock.
-- `ord` gives each table its order of creation, which no clock can disturb.

CREATE TABLE subjects (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    display_name TEXT NOT NULL,
    consent_note TEXT NOT NULL,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec'))
) STRICT;

CREATE TABLE captures (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    subject      TEXT NOT NULL REFERENCES subjects (id),
    state        TEXT NOT NULL DEFAULT 'UPLOADING'
                 CHECK (state IN ('UPLOADING', 'INGESTING', 'READY', 'REJECTED')),
    frames       INTEGER NOT NULL DEFAULT 0,
    width        INTEGER NOT NULL DEFAULT 0,
    height       INTEGER NOT NULL DEFAULT 0,
    shard_key    TEXT,
    shard_bytes  INTEGER,
    shard_sha256 TEXT,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec')),
    CHECK ((state = 'READY') = (shard_key IS NOT NULL))
) STRICT;
CREATE INDEX captures_of_subject ON captures (subject, state);

-- A subject's state follows from its captures, so the two can never disagree.
CREATE VIEW subject_catalogue AS
SELECT s.*,
       CASE
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'READY')
               THEN 'READY'
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'INGESTING')
               THEN 'INGESTING'
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'REJECTED')
               THEN 'REJECTED'
           ELSE 'UPLOADING'
       END AS state,
       (SELECT group_concat(c.id, ',' ORDER BY c.ord) FROM captures c WHERE c.subject = s.id)
           AS captures
FROM subjects s;

CREATE TABLE capture_files (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    path    TEXT NOT NULL,
    bytes   INTEGER NOT NULL,
    sha256  TEXT NOT NULL,
    PRIMARY KEY (capture, path)
) STRICT, WITHOUT ROWID;

-- Why a capture was rejected, in the order of discovery.
CREATE TABLE capture_violations (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    number  INTEGER NOT NULL,
    code    TEXT NOT NULL,
    file    TEXT NOT NULL,
    frame   INTEGER,
    field   TEXT NOT NULL,
    message TEXT NOT NULL,
    PRIMARY KEY (capture, number)
) STRICT, WITHOUT ROWID;

-- `next_slot` only grows: a slot whose subject is gone is never given to another.
CREATE TABLE models (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    display_name TEXT NOT NULL,
    tier         TEXT NOT NULL,
    variant      TEXT NOT NULL,
    next_slot    INTEGER NOT NULL DEFAULT 0,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec'))
) STRICT;

CREATE TABLE slots (
    model   TEXT NOT NULL REFERENCES models (id),
    slot    INTEGER NOT NULL,
    subject TEXT NOT NULL REFERENCES subjects (id),
    PRIMARY KEY (model, slot),
    UNIQUE (model, subject)
) STRICT, WITHOUT ROWID;

CREATE TABLE workers (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    display_name TEXT NOT NULL,
    backend      TEXT NOT NULL,
    adapter      TEXT NOT NULL,
    gpu          INTEGER NOT NULL CHECK (gpu IN (0, 1)),
    memory_bytes INTEGER NOT NULL,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec'))
) STRICT;

CREATE TABLE worker_kinds (
    worker TEXT NOT NULL REFERENCES workers (id) ON DELETE CASCADE,
    kind   TEXT NOT NULL CHECK (kind IN ('ingest', 'train', 'render')),
    PRIMARY KEY (worker, kind)
) STRICT, WITHOUT ROWID;

-- `spec`, `progress`, `result` and `error` hold encoded yoto.v1 messages.
-- `lease` is the fencing token: it only grows, by one at each lease.
CREATE TABLE jobs (
    ord              INTEGER PRIMARY KEY AUTOINCREMENT,
    id               TEXT NOT NULL UNIQUE,
    kind             TEXT NOT NULL CHECK (kind IN ('ingest', 'train', 'render')),
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
CREATE INDEX jobs_by_state ON jobs (state, ord);
CREATE UNIQUE INDEX one_ingest_a_capture ON jobs (capture);
CREATE UNIQUE INDEX one_trainer_a_model ON jobs (model) WHERE kind = 'train' AND state = 'RUNNING';

CREATE TABLE checkpoints (
    model           TEXT NOT NULL REFERENCES models (id),
    step            INTEGER NOT NULL,
    job             TEXT NOT NULL REFERENCES jobs (id),
    manifest_key    TEXT NOT NULL,
    manifest_bytes  INTEGER NOT NULL,
    manifest_sha256 TEXT NOT NULL,
    bytes           INTEGER NOT NULL,
    psnr            REAL,
    create_time     REAL NOT NULL DEFAULT (unixepoch('subsec')),
    PRIMARY KEY (model, step)
) STRICT, WITHOUT ROWID;

-- What was answered to a request id, so that a repeated call gets the same answer.
CREATE TABLE request_ids (
    method      TEXT NOT NULL,
    request_id  TEXT NOT NULL,
    body_sha256 TEXT NOT NULL,
    answer      TEXT NOT NULL,
    create_time REAL NOT NULL DEFAULT (unixepoch('subsec')),
    PRIMARY KEY (method, request_id)
) STRICT, WITHOUT ROWID;
