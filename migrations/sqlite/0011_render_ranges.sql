-- Several workers draw the pictures of one render: one runs the job, as before, and others help it. Each has a
-- lease of its own with a token of the job's one counter, `last_token`; `jobs.lease` is that of the worker that
-- runs the job. An attempt with a deadline is a helper's, as long as it lasts.
ALTER TABLE jobs ADD COLUMN last_token INTEGER NOT NULL DEFAULT 0;
UPDATE jobs SET last_token = lease;
ALTER TABLE job_attempts ADD COLUMN lease_deadline REAL;
ALTER TABLE job_attempts ADD COLUMN lease_request TEXT;
CREATE INDEX helping ON job_attempts (worker, job, lease) WHERE lease_deadline IS NOT NULL;

-- All leases that last: each of them guards the writes of its worker.
CREATE VIEW leases AS
SELECT id AS job, lease AS token, worker, lease_deadline, lease_request
FROM jobs WHERE state = 'RUNNING'
UNION ALL
SELECT job, lease, worker, lease_deadline, lease_request
FROM job_attempts WHERE lease_deadline IS NOT NULL;

-- Pictures of an open render that follow each other, and the lease that draws them: NULL while nobody does.
CREATE TABLE render_ranges (
    job      TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    first    INTEGER NOT NULL,
    pictures INTEGER NOT NULL CHECK (pictures > 0),
    token    INTEGER,
    drawn    INTEGER NOT NULL DEFAULT 0 CHECK (drawn IN (0, 1)),
    PRIMARY KEY (job, first),
    CHECK (drawn = 0 OR token IS NULL)
) STRICT, WITHOUT ROWID;
