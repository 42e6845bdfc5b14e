-- Priority (0 low, 1 normal, 2 high, 3 urgent) and owner of a job decide whose turn it is.
-- `waiting_error`: the encoded JobError for which a QUEUED job was put back. `lease_request`: the id of
-- the call that leased the job, which finds the lease again. `losses`: workers lost since the job's last
-- published checkpoint, of which only so many are allowed; `lost_workers` counts all of them.
ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 1 CHECK (priority BETWEEN 0 AND 3);
ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN waiting_error BLOB;
ALTER TABLE jobs ADD COLUMN lease_request TEXT;
ALTER TABLE jobs ADD COLUMN losses INTEGER NOT NULL DEFAULT 0;
UPDATE jobs SET losses = lost_workers;
DROP INDEX jobs_by_state;
-- Covers the search for the next job, so that it reads no rows of those that wait.
CREATE INDEX jobs_in_turn ON jobs (state, kind, priority DESC, ord, owner, model, not_before);
-- Counts the jobs ahead of another.
CREATE INDEX jobs_by_state ON jobs (state, priority DESC, ord);
CREATE INDEX jobs_of_model ON jobs (model, ord);
CREATE INDEX jobs_of_worker ON jobs (worker);

-- The capture of each person whom a job needs, chosen when the job is queued: a newer one that comes
-- meanwhile does not change it.
CREATE TABLE job_captures (
    job     TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    subject TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    PRIMARY KEY (job, subject)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_captures_of_capture ON job_captures (capture);
CREATE INDEX job_captures_of_subject ON job_captures (subject);

-- Every lease of a job, also after its end. `outcome` is a JobAttempt.Outcome, `error` an encoded JobError.
CREATE TABLE job_attempts (
    job        TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    lease      INTEGER NOT NULL,
    worker     TEXT NOT NULL REFERENCES workers (id),
    begin_time REAL NOT NULL,
    end_time   REAL,
    outcome    TEXT NOT NULL DEFAULT 'RUNNING',
    error      BLOB,
    PRIMARY KEY (job, lease),
    CHECK ((outcome = 'RUNNING') = (end_time IS NULL))
) STRICT, WITHOUT ROWID;
CREATE INDEX attempts_of_worker ON job_attempts (worker);

-- Files of a render that users can see already, and that no later lease makes again.
CREATE TABLE job_outputs (
    ord    INTEGER PRIMARY KEY AUTOINCREMENT,
    job    TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    file   TEXT NOT NULL,
    key    TEXT NOT NULL,
    bytes  INTEGER NOT NULL,
    sha256 TEXT NOT NULL,
    UNIQUE (job, file)
) STRICT;

-- Kinds of jobs that are not leased at present.
CREATE TABLE paused_kinds (
    kind   TEXT PRIMARY KEY,
    reason TEXT NOT NULL,
    since  REAL NOT NULL
) STRICT, WITHOUT ROWID;

-- When leases were last looked after: a longer gap is an outage of the service, or a step of its clock,
-- which no worker has to answer for.
CREATE TABLE lease_clock (
    id        INTEGER PRIMARY KEY CHECK (id = 1),
    last_tick REAL NOT NULL
) STRICT;

-- Whether the worker runs in the coordinator's process, and so ended with it.
ALTER TABLE workers ADD COLUMN embedded INTEGER NOT NULL DEFAULT 0 CHECK (embedded IN (0, 1));
