-- The whole schema. Later steps change it, and have the same numbers and names here and in migrations/postgres.
--
-- Times are seconds since 1970 by the database's clock, flags the integers 0 and 1, SHA-256 lower-case hex. `ord` gives each
-- table its order of creation, which no clock can disturb. A time stamp that no user sees, and from which the age of its row
-- counts, is called `…_since`: it is corrected when the clock is set back.
--
-- Every row that a user can reach belongs to one tenant. Some tables have the column `tenant`. The others reach it by their
-- parent, so that the two can never disagree. The default '' is no tenant: a statement that forgets the tenant makes a row that
-- no tenant finds. Garbage, clocks and the store of objects are the service's.

-- ---------------------------------------------------------------------------------------------------------------- people

-- A subject: a person whom captures show.
CREATE TABLE subjects (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    display_name TEXT NOT NULL,
    consent_note TEXT NOT NULL,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec')),
    tenant       TEXT NOT NULL DEFAULT ''
) STRICT;
-- An index has the row's `ord` too: the pages of a list.
CREATE INDEX subjects_of_tenant ON subjects (tenant);

-- A consent of a person. It stays after it was revoked or has run out: it is what stops jobs then.
CREATE TABLE consents (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    subject     TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    -- Who gave it; empty: the person.
    given_by    TEXT NOT NULL,
    note        TEXT NOT NULL,
    create_time REAL NOT NULL,
    -- NULL: it does not run out.
    expire_time REAL
) STRICT;
CREATE INDEX consents_of_subject ON consents (subject, ord);

-- A purpose to which a consent agrees.
CREATE TABLE consent_purposes (
    consent     TEXT NOT NULL REFERENCES consents (id) ON DELETE CASCADE,
    purpose     TEXT NOT NULL CHECK (purpose IN ('CONSENT_TRAIN', 'CONSENT_RENDER', 'CONSENT_EXPORT', 'CONSENT_SHARE')),
    revoke_time REAL,
    PRIMARY KEY (consent, purpose)
) STRICT, WITHOUT ROWID;

-- A small file that proves a consent, and goes with it.
CREATE TABLE consent_evidence (
    consent   TEXT NOT NULL PRIMARY KEY REFERENCES consents (id) ON DELETE CASCADE,
    file_name TEXT NOT NULL,
    bytes     INTEGER NOT NULL,
    sha256    TEXT NOT NULL,
    content   BLOB NOT NULL
) STRICT, WITHOUT ROWID;

-- -------------------------------------------------------------------------------------------------------------- captures

-- A capture of a person, from its upload on.
CREATE TABLE captures (
    ord           INTEGER PRIMARY KEY AUTOINCREMENT,
    id            TEXT NOT NULL UNIQUE,
    subject       TEXT NOT NULL REFERENCES subjects (id),
    state         TEXT NOT NULL DEFAULT 'UPLOADING'
                  CHECK (state IN ('UPLOADING', 'UPLOADED', 'INGESTING', 'READY', 'REJECTED')),
    create_time   REAL NOT NULL DEFAULT (unixepoch('subsec')),
    -- Time of the last write of an upload, which decides when it ends by itself.
    idle_since    REAL NOT NULL DEFAULT (unixepoch('subsec')),
    -- The number of calls that took over this upload: only the newest of them commits.
    writer        INTEGER NOT NULL DEFAULT 0,
    -- Whether the uploaded files were removed, or are being removed.
    files_removed INTEGER NOT NULL DEFAULT 0 CHECK (files_removed IN (0, 1)),
    frames        INTEGER NOT NULL DEFAULT 0,
    width         INTEGER NOT NULL DEFAULT 0,
    height        INTEGER NOT NULL DEFAULT 0,
    -- Numbers of a READY capture's first and last frame; NULL for captures that earlier versions read.
    first_frame   INTEGER,
    last_frame    INTEGER,
    shard_key     TEXT,
    shard_bytes   INTEGER,
    shard_sha256  TEXT,
    CHECK ((state = 'READY') = (shard_key IS NOT NULL))
) STRICT;
CREATE INDEX captures_of_subject ON captures (subject, state);
CREATE INDEX open_uploads ON captures (idle_since) WHERE state = 'UPLOADING';

-- A subject with its state, which follows from its captures, so that the two can never disagree.
CREATE VIEW subject_catalogue AS
SELECT s.*,
       CASE
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'READY')
               THEN 'READY'
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'INGESTING')
               THEN 'INGESTING'
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'UPLOADED')
               THEN 'UPLOADED'
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'REJECTED')
               THEN 'REJECTED'
           ELSE 'UPLOADING'
       END AS state,
       (SELECT group_concat(c.id, ',' ORDER BY c.ord) FROM captures c WHERE c.subject = s.id)
           AS captures
FROM subjects s;

-- A file of an upload, and how much of it was committed.
CREATE TABLE capture_files (
    capture   TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    path      TEXT NOT NULL,
    bytes     INTEGER NOT NULL,
    sha256    TEXT NOT NULL,
    committed INTEGER NOT NULL DEFAULT 0 CHECK (committed BETWEEN 0 AND bytes),
    PRIMARY KEY (capture, path)
) STRICT, WITHOUT ROWID;

-- A part of an upload: an object that is written once, with what was committed at once.
CREATE TABLE upload_parts (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    -- The writer that has committed it, and its number among that writer's commits. In this order, the parts have the bytes
    -- of each file in their order. Files of uploads that an early version began are parts of writer 0.
    writer  INTEGER NOT NULL,
    number  INTEGER NOT NULL,
    key     TEXT NOT NULL,
    -- The object of a file that was not complete may have more.
    bytes   INTEGER NOT NULL CHECK (bytes > 0),
    -- Empty for a file that was not complete.
    sha256  TEXT NOT NULL,
    PRIMARY KEY (capture, writer, number)
) STRICT, WITHOUT ROWID;

-- Bytes of a file in a part.
CREATE TABLE upload_pieces (
    capture    TEXT NOT NULL,
    path       TEXT NOT NULL,
    -- The first byte in the file.
    start      INTEGER NOT NULL CHECK (start >= 0),
    bytes      INTEGER NOT NULL CHECK (bytes > 0),
    writer     INTEGER NOT NULL,
    number     INTEGER NOT NULL,
    -- The first byte in the part.
    part_start INTEGER NOT NULL CHECK (part_start >= 0),
    PRIMARY KEY (capture, path, start),
    FOREIGN KEY (capture, path) REFERENCES capture_files (capture, path) ON DELETE CASCADE,
    FOREIGN KEY (capture, writer, number) REFERENCES upload_parts (capture, writer, number) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
CREATE INDEX pieces_of_parts ON upload_pieces (capture, writer, number, part_start);

-- A reason for which a capture was rejected, by the order of discovery.
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

-- A file that an ingest job made of a capture for people, in the folder of its shard: the check's report, a thumbnail.
CREATE TABLE capture_objects (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    file    TEXT NOT NULL,
    key     TEXT NOT NULL,
    bytes   INTEGER NOT NULL,
    sha256  TEXT NOT NULL,
    PRIMARY KEY (capture, file)
) STRICT, WITHOUT ROWID;

-- ---------------------------------------------------------------------------------------------------------------- models

-- A model of one person or several.
CREATE TABLE models (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    tenant       TEXT NOT NULL DEFAULT '',
    display_name TEXT NOT NULL,
    tier         TEXT NOT NULL,
    variant      TEXT NOT NULL,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec')),
    -- It only grows: a slot whose subject is gone is never given to another.
    next_slot    INTEGER NOT NULL DEFAULT 0,
    -- Which checkpoints the model keeps; NULL: the service's default.
    keep_newest  INTEGER,
    keep_every   INTEGER,
    -- How many checkpoints were published of it.
    published    INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE INDEX models_of_tenant ON models (tenant);

-- A person in a model.
CREATE TABLE slots (
    model   TEXT NOT NULL REFERENCES models (id),
    slot    INTEGER NOT NULL,
    subject TEXT NOT NULL REFERENCES subjects (id),
    PRIMARY KEY (model, slot),
    UNIQUE (model, subject)
) STRICT, WITHOUT ROWID;

-- ------------------------------------------------------------------------------------------------------ keys and workers

-- A key of a caller. It stays after it was revoked or has expired: from the first key on, the service asks for one.
CREATE TABLE keys (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    tenant       TEXT NOT NULL,
    display_name TEXT NOT NULL,
    -- Of the whole key.
    sha256       TEXT NOT NULL UNIQUE,
    -- Names of scopes with spaces between them.
    scopes       TEXT NOT NULL,
    -- Whether the service made it for a person who has signed in.
    session      INTEGER NOT NULL DEFAULT 0,
    create_time  REAL NOT NULL,
    expire_time  REAL,
    used_time    REAL,
    revoke_time  REAL
) STRICT;
CREATE INDEX keys_of_tenant ON keys (tenant, ord);

-- A worker that has registered.
CREATE TABLE workers (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    tenant       TEXT NOT NULL DEFAULT '',
    -- The key with which it has registered; NULL where no key was asked for.
    key          TEXT REFERENCES keys (id),
    display_name TEXT NOT NULL,
    backend      TEXT NOT NULL,
    adapter      TEXT NOT NULL,
    gpu          INTEGER NOT NULL CHECK (gpu IN (0, 1)),
    memory_bytes INTEGER NOT NULL,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec')),
    -- When it last asked for a job, noted at most every half minute.
    asked_time   REAL,
    -- For people.
    version      TEXT NOT NULL DEFAULT '',
    -- It gets jobs up to this level of orders; 0 for workers of versions that knew no levels.
    order_level  INTEGER NOT NULL DEFAULT 0,
    -- Whether it has a pose model, and so ingests films without poses.
    reads_films  INTEGER NOT NULL DEFAULT 0,
    -- Whether it runs in a coordinator's process, and so ended with it.
    embedded     INTEGER NOT NULL DEFAULT 0 CHECK (embedded IN (0, 1)),
    -- That coordinator; NULL for other workers, and for those of an early version.
    instance     TEXT
) STRICT;
CREATE INDEX workers_of_tenant ON workers (tenant);

-- A kind of job that a worker takes.
CREATE TABLE worker_kinds (
    worker TEXT NOT NULL REFERENCES workers (id) ON DELETE CASCADE,
    kind   TEXT NOT NULL CHECK (kind IN ('ingest', 'train', 'render', 'evaluate', 'export')),
    PRIMARY KEY (worker, kind)
) STRICT, WITHOUT ROWID;

-- A display name whose workers get no leases, also after they have registered again.
CREATE TABLE cordons (
    tenant TEXT NOT NULL,
    worker TEXT NOT NULL,
    reason TEXT NOT NULL,
    since  REAL NOT NULL,
    PRIMARY KEY (tenant, worker)
);

-- ------------------------------------------------------------------------------------------------------------------ jobs

-- A job, from its order on. `spec`, `progress`, `result` and the errors are encoded messages of yoto.v1.
CREATE TABLE jobs (
    ord              INTEGER PRIMARY KEY AUTOINCREMENT,
    id               TEXT NOT NULL UNIQUE,
    tenant           TEXT NOT NULL DEFAULT '',
    kind             TEXT NOT NULL CHECK (kind IN ('ingest', 'train', 'render', 'evaluate', 'export')),
    capture          TEXT REFERENCES captures (id),
    model            TEXT REFERENCES models (id),
    -- Step of the checkpoint that a render or evaluate job uses, which is kept while the job is open; NULL for jobs of early
    -- versions, which do not say.
    pinned_step      INTEGER,
    state            TEXT NOT NULL DEFAULT 'QUEUED'
                     CHECK (state IN ('QUEUED', 'RUNNING', 'SUCCEEDED', 'FAILED', 'CANCELLED')),
    spec             BLOB NOT NULL,
    progress         BLOB,
    result           BLOB,
    error            BLOB,
    -- The number of the row's version, by which watchers find changes.
    sequence         INTEGER NOT NULL DEFAULT 1,
    create_time      REAL NOT NULL DEFAULT (unixepoch('subsec')),
    start_time       REAL,
    end_time         REAL,
    -- 0 low, 1 normal, 2 high, 3 urgent. With the owner, it decides whose turn it is.
    priority         INTEGER NOT NULL DEFAULT 1 CHECK (priority BETWEEN 0 AND 3),
    owner            TEXT NOT NULL DEFAULT '',
    -- The level that a worker needs to understand the order.
    order_level      INTEGER NOT NULL DEFAULT 1,
    -- Whether it ingests a film without poses.
    film             INTEGER NOT NULL DEFAULT 0,
    -- The worker that runs the job, and its lease: a token that only grows. Helpers have their own in `job_attempts`.
    worker           TEXT REFERENCES workers (id),
    lease            INTEGER NOT NULL DEFAULT 0,
    lease_deadline   REAL,
    -- The id of the call that leased the job, which finds the lease again.
    lease_request    TEXT,
    -- The highest token of the job's leases, those of helpers among them.
    last_token       INTEGER NOT NULL DEFAULT 0,
    cancel_requested INTEGER NOT NULL DEFAULT 0 CHECK (cancel_requested IN (0, 1)),
    -- All workers that the job has lost, and those since its last published checkpoint, whose number is limited.
    lost_workers     INTEGER NOT NULL DEFAULT 0,
    losses           INTEGER NOT NULL DEFAULT 0,
    -- How often it was tried again after a failure through no fault of its own, and the time up to which it waits for that.
    retries          INTEGER NOT NULL DEFAULT 0,
    not_before       REAL,
    -- The error for which a QUEUED job was put back.
    waiting_error    BLOB,
    -- The header `traceparent` of the call that queued the job; NULL: it had none.
    trace_parent     TEXT,
    CHECK ((state = 'RUNNING') = (lease_deadline IS NOT NULL)),
    CHECK ((state IN ('SUCCEEDED', 'FAILED', 'CANCELLED')) = (end_time IS NOT NULL)),
    CHECK ((kind = 'ingest') = (capture IS NOT NULL)),
    CHECK ((kind = 'ingest') = (model IS NULL))
) STRICT;
CREATE UNIQUE INDEX one_trainer_a_model ON jobs (model) WHERE kind = 'train' AND state = 'RUNNING';
-- Covers the search for the next job of a tenant, so that it reads no rows of those that wait.
CREATE INDEX jobs_in_turn ON jobs (state, tenant, kind, priority DESC, ord, owner, model, not_before, order_level);
-- Counts the jobs ahead of another.
CREATE INDEX jobs_by_state ON jobs (state, tenant, priority DESC, ord);
CREATE INDEX jobs_of_tenant ON jobs (tenant);
CREATE INDEX jobs_of_model ON jobs (model, ord);
CREATE INDEX jobs_of_worker ON jobs (worker);
CREATE INDEX ingests_of_capture ON jobs (capture, ord) WHERE capture IS NOT NULL;
CREATE UNIQUE INDEX one_open_ingest_a_capture ON jobs (capture)
    WHERE capture IS NOT NULL AND state IN ('QUEUED', 'RUNNING');

-- A capture that a job needs of a person, chosen when the job is queued: a newer one that comes meanwhile does not change it.
CREATE TABLE job_captures (
    job     TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    subject TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    PRIMARY KEY (job, subject)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_captures_of_capture ON job_captures (capture);
CREATE INDEX job_captures_of_subject ON job_captures (subject);

-- A checkpoint of another model that a render uses: people of a scene may be of several. The job's own model has
-- `jobs.pinned_step`.
CREATE TABLE job_models (
    job   TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    model TEXT NOT NULL REFERENCES models (id) ON DELETE CASCADE,
    step  INTEGER NOT NULL,
    PRIMARY KEY (job, model)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_models_of_model ON job_models (model);

-- A lease of a job, also after its end. Several workers draw the pictures of one render: one runs the job, and others help it.
CREATE TABLE job_attempts (
    job            TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    lease          INTEGER NOT NULL,
    worker         TEXT NOT NULL REFERENCES workers (id),
    begin_time     REAL NOT NULL,
    end_time       REAL,
    -- A JobAttempt.Outcome, and an encoded JobError.
    outcome        TEXT NOT NULL DEFAULT 'RUNNING',
    error          BLOB,
    -- Of a helper's lease, as long as it lasts.
    lease_deadline REAL,
    lease_request  TEXT,
    PRIMARY KEY (job, lease),
    CHECK ((outcome = 'RUNNING') = (end_time IS NULL))
) STRICT, WITHOUT ROWID;
CREATE INDEX attempts_of_worker ON job_attempts (worker);
CREATE INDEX helping ON job_attempts (worker, job, lease) WHERE lease_deadline IS NOT NULL;

-- A lease that lasts: it guards the writes of its worker.
CREATE VIEW leases AS
SELECT id AS job, lease AS token, worker, lease_deadline, lease_request
FROM jobs WHERE state = 'RUNNING'
UNION ALL
SELECT job, lease, worker, lease_deadline, lease_request
FROM job_attempts WHERE lease_deadline IS NOT NULL;

-- Pictures of an open render that follow each other.
CREATE TABLE render_ranges (
    job      TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    first    INTEGER NOT NULL,
    pictures INTEGER NOT NULL CHECK (pictures > 0),
    -- The lease that draws them; NULL while nobody does.
    token    INTEGER,
    drawn    INTEGER NOT NULL DEFAULT 0 CHECK (drawn IN (0, 1)),
    PRIMARY KEY (job, first),
    CHECK (drawn = 0 OR token IS NULL)
) STRICT, WITHOUT ROWID;

-- A file of a job that users can see already, and that no later lease makes again.
CREATE TABLE job_outputs (
    ord    INTEGER PRIMARY KEY AUTOINCREMENT,
    job    TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    file   TEXT NOT NULL,
    key    TEXT NOT NULL,
    bytes  INTEGER NOT NULL,
    sha256 TEXT NOT NULL,
    UNIQUE (job, file)
) STRICT;

-- Figures of a training at a step, thinned, so that a curve can be drawn.
CREATE TABLE job_metrics (
    job     TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    step    INTEGER NOT NULL,
    seconds REAL NOT NULL,
    loss    REAL NOT NULL,
    -- On held-out frames, at the steps at which they were measured.
    psnr    REAL,
    ssim    REAL,
    PRIMARY KEY (job, step)
) STRICT, WITHOUT ROWID;

-- A kind of job that is not leased at present.
CREATE TABLE paused_kinds (
    tenant TEXT NOT NULL,
    kind   TEXT NOT NULL,
    reason TEXT NOT NULL,
    since  REAL NOT NULL,
    PRIMARY KEY (tenant, kind)
) STRICT, WITHOUT ROWID;

-- The drain: while there is a row, the service takes no new jobs and gives no leases.
CREATE TABLE drains (
    id     INTEGER PRIMARY KEY CHECK (id = 1),
    reason TEXT NOT NULL,
    since  REAL NOT NULL
);

-- ----------------------------------------------------------------------------------------------------------- checkpoints

-- A published checkpoint of a model. It outlives the row of its job.
CREATE TABLE checkpoints (
    model           TEXT NOT NULL REFERENCES models (id),
    step            INTEGER NOT NULL,
    -- Its position among all that were published of its model.
    number          INTEGER NOT NULL,
    job             TEXT REFERENCES jobs (id) ON DELETE SET NULL,
    create_time     REAL NOT NULL DEFAULT (unixepoch('subsec')),
    manifest_key    TEXT NOT NULL,
    manifest_bytes  INTEGER NOT NULL,
    manifest_sha256 TEXT NOT NULL,
    bytes           INTEGER NOT NULL,
    psnr            REAL,
    -- The slots and the SHA-256 of the shards that it was trained on, each separated by commas, and the longest side of its
    -- training images, pixels (0: the captures' own); NULL for checkpoints of early versions, which do not say.
    slots           TEXT,
    shards          TEXT,
    image_size      INTEGER,
    -- Its measured trade of seconds for fidelity: the object with the curve. The three are set together; replacing the
    -- checkpoint clears them with it.
    tradeoff_key    TEXT,
    tradeoff_bytes  INTEGER,
    tradeoff_sha256 TEXT,
    PRIMARY KEY (model, step)
) STRICT, WITHOUT ROWID;
CREATE INDEX checkpoints_of_job ON checkpoints (job);

-- A name that people give a checkpoint.
CREATE TABLE checkpoint_aliases (
    model TEXT NOT NULL,
    alias TEXT NOT NULL,
    step  INTEGER NOT NULL,
    PRIMARY KEY (model, alias),
    FOREIGN KEY (model, step) REFERENCES checkpoints (model, step) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
CREATE INDEX checkpoint_aliases_of_checkpoint ON checkpoint_aliases (model, step);

-- --------------------------------------------------------------------------------------------------- shares and webhooks

-- A link to the page of an export. It goes with its job or its person.
CREATE TABLE shares (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    job         TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    subject     TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    -- Of the link's secret.
    sha256      TEXT NOT NULL UNIQUE,
    note        TEXT NOT NULL,
    -- Whether other sites may show the page.
    embed       INTEGER NOT NULL CHECK (embed IN (0, 1)),
    create_time REAL NOT NULL,
    -- NULL: never.
    expire_time REAL,
    revoke_time REAL
) STRICT;
CREATE INDEX shares_of_tenant ON shares (tenant, ord);
CREATE INDEX shares_of_job ON shares (job);
CREATE INDEX shares_of_subject ON shares (subject);

-- An address that is told when jobs end.
CREATE TABLE webhooks (
    ord         INTEGER PRIMARY KEY,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    url         TEXT NOT NULL,
    -- The secret itself: signatures are made with it.
    secret      TEXT NOT NULL,
    note        TEXT NOT NULL,
    create_time REAL NOT NULL,
    last_time   REAL,
    last_error  TEXT NOT NULL DEFAULT ''
) STRICT;
CREATE INDEX webhooks_of_tenant ON webhooks (tenant, ord);

-- A job's end that an address is still to be told.
CREATE TABLE webhook_deliveries (
    ord       INTEGER PRIMARY KEY,
    id        TEXT NOT NULL UNIQUE,
    webhook   TEXT NOT NULL REFERENCES webhooks (id) ON DELETE CASCADE,
    job       TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    attempts  INTEGER NOT NULL DEFAULT 0,
    -- No coordinator tries before this time; one that tries now has moved it.
    next_time REAL NOT NULL
) STRICT;
CREATE INDEX webhook_deliveries_by_time ON webhook_deliveries (next_time);
CREATE INDEX webhook_deliveries_of_webhook ON webhook_deliveries (webhook);
CREATE INDEX webhook_deliveries_of_job ON webhook_deliveries (job);

-- -------------------------------------------------------------------------------------------------------------- erasures

-- A removal of a person. It stays, without the person's name.
CREATE TABLE erasures (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    -- The person's id, whose row is gone in the end.
    subject     TEXT NOT NULL,
    name_sha256 TEXT NOT NULL,
    state       TEXT NOT NULL DEFAULT 'RUNNING' CHECK (state IN ('RUNNING', 'DONE', 'FAILED')),
    -- Whether it also trains the others of a model anew.
    retrain     INTEGER NOT NULL DEFAULT 0,
    create_time REAL NOT NULL,
    end_time    REAL,
    message     TEXT NOT NULL DEFAULT '',
    -- JSON: what was removed from the rows and is to be removed from the store. NULL before and after that.
    work        TEXT,
    report      TEXT NOT NULL DEFAULT '',
    signature   TEXT NOT NULL DEFAULT '',
    public_key  TEXT NOT NULL DEFAULT ''
) STRICT;
CREATE INDEX erasures_of_tenant ON erasures (tenant, ord);
CREATE UNIQUE INDEX one_erasure_a_person ON erasures (subject);

-- A model from which an erasure takes the person, with the job that does so.
CREATE TABLE erasure_models (
    erasure   TEXT NOT NULL REFERENCES erasures (id) ON DELETE CASCADE,
    model     TEXT NOT NULL REFERENCES models (id) ON DELETE CASCADE,
    job       TEXT NOT NULL,
    -- The model that the erasure has made to train the others anew.
    retrained TEXT,
    PRIMARY KEY (erasure, model)
) STRICT, WITHOUT ROWID;

-- ------------------------------------------------------------------------------------------------------ tenants and calls

-- What a tenant may use at most. NULL, and a tenant without a row: no limit.
CREATE TABLE quotas (
    tenant           TEXT NOT NULL PRIMARY KEY,
    people           INTEGER CHECK (people >= 0),
    bytes            INTEGER CHECK (bytes >= 0),
    open_jobs        INTEGER CHECK (open_jobs >= 0),
    device_seconds   REAL CHECK (device_seconds >= 0),
    pictures         INTEGER CHECK (pictures >= 0),
    calls_per_second REAL CHECK (calls_per_second >= 0)
) STRICT, WITHOUT ROWID;

-- What workers have done for a tenant on a day, so that deletion of a job takes nothing back.
CREATE TABLE work_of_days (
    tenant         TEXT NOT NULL,
    -- Days since 1970, UTC.
    day            INTEGER NOT NULL,
    device_seconds REAL NOT NULL DEFAULT 0,
    pictures       INTEGER NOT NULL DEFAULT 0,
    PRIMARY KEY (tenant, day)
) STRICT, WITHOUT ROWID;

-- What was answered to a request id, so that a repeated call gets the same answer.
CREATE TABLE request_ids (
    tenant      TEXT NOT NULL,
    method      TEXT NOT NULL,
    request_id  TEXT NOT NULL,
    body_sha256 TEXT NOT NULL,
    answer      TEXT NOT NULL,
    kept_since  REAL NOT NULL,
    PRIMARY KEY (tenant, method, request_id)
) STRICT, WITHOUT ROWID;

-- An entry of the audit log: who calls what that changes something, before the call and after it.
CREATE TABLE audit (
    number       INTEGER PRIMARY KEY,
    time         REAL NOT NULL,
    tenant       TEXT NOT NULL,
    -- Id of the caller's key; empty: none was asked for.
    key          TEXT NOT NULL,
    call         TEXT NOT NULL,
    -- Names of resources, with spaces between them; an erasure empties it, and leaves the SHA-256 of what it was.
    names        TEXT NOT NULL,
    names_sha256 TEXT NOT NULL,
    -- Number of the entry before the call; NULL in that entry.
    began        INTEGER,
    outcome      TEXT NOT NULL,
    -- Of all entries up to this one (server/store/src/audit_chain.rs).
    hash         TEXT NOT NULL
) STRICT;

-- ----------------------------------------------------------------------------------------------------------- the service

-- The store in which the objects of these rows are. Several coordinators share a database if they share it.
CREATE TABLE object_store (
    one INTEGER PRIMARY KEY CHECK (one = 1),
    id  TEXT NOT NULL
) STRICT;

-- A folder of the object store that nothing refers to any more.
CREATE TABLE garbage (
    folder        TEXT PRIMARY KEY,
    -- Whether it belonged to something that was deleted, so that everything below it is garbage as well.
    deleted       INTEGER NOT NULL CHECK (deleted IN (0, 1)),
    garbage_since REAL NOT NULL DEFAULT (unixepoch('subsec'))
) STRICT, WITHOUT ROWID;

-- When leases were last looked after: a longer gap is an outage of the service, or a step of its clock, which no worker has to
-- answer for.
CREATE TABLE lease_clock (
    id        INTEGER PRIMARY KEY CHECK (id = 1),
    last_tick REAL NOT NULL
) STRICT;

-- When the service last looked at its clock.
CREATE TABLE service_clock (
    id        INTEGER PRIMARY KEY CHECK (id = 1),
    last_tick REAL NOT NULL
) STRICT;

-- A time by which the clock moved without time that the service spent: it was set, the machine slept, or the service was down.
CREATE TABLE clock_steps (
    ord     INTEGER PRIMARY KEY AUTOINCREMENT,
    at      REAL NOT NULL,
    -- They count for no time stamp up to `at`; below 0: the clock was set back.
    seconds REAL NOT NULL
) STRICT;
