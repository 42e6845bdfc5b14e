-- A database of the program of 28 November 2026 (commit 5ce29de0): the schema as its 37 steps up to 38 left it, their records, and
-- rows in every table. A training `j` runs, an ingest job `i` waits, and `open` is an upload.

CREATE TABLE _sqlx_migrations (
    version BIGINT PRIMARY KEY,
    description TEXT NOT NULL,
    installed_on TIMESTAMP NOT NULL DEFAULT CURRENT_TIMESTAMP,
    success BOOLEAN NOT NULL,
    checksum BLOB NOT NULL,
    execution_time BIGINT NOT NULL
);
CREATE TABLE subjects (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    display_name TEXT NOT NULL,
    consent_note TEXT NOT NULL,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec'))
, tenant TEXT NOT NULL DEFAULT '') STRICT;
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
CREATE TABLE models (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    display_name TEXT NOT NULL,
    tier         TEXT NOT NULL,
    variant      TEXT NOT NULL,
    next_slot    INTEGER NOT NULL DEFAULT 0,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec'))
, keep_newest INTEGER, keep_every INTEGER, published INTEGER NOT NULL DEFAULT 0, tenant TEXT NOT NULL DEFAULT '') STRICT;
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
, embedded INTEGER NOT NULL DEFAULT 0 CHECK (embedded IN (0, 1)), tenant TEXT NOT NULL DEFAULT '', order_level INTEGER NOT NULL DEFAULT 0, version TEXT NOT NULL DEFAULT '', asked_time REAL, instance TEXT, key TEXT REFERENCES keys (id), reads_films INTEGER NOT NULL DEFAULT 0) STRICT;
CREATE TABLE "worker_kinds" (
    worker TEXT NOT NULL REFERENCES workers (id) ON DELETE CASCADE,
    kind   TEXT NOT NULL CHECK (kind IN ('ingest', 'train', 'render', 'evaluate', 'export')),
    PRIMARY KEY (worker, kind)
) STRICT, WITHOUT ROWID;
CREATE TABLE "jobs" (
    ord              INTEGER PRIMARY KEY AUTOINCREMENT,
    id               TEXT NOT NULL UNIQUE,
    kind             TEXT NOT NULL CHECK (kind IN ('ingest', 'train', 'render', 'evaluate', 'export')),
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
    end_time         REAL, retries INTEGER NOT NULL DEFAULT 0, not_before REAL, pinned_step INTEGER, priority INTEGER NOT NULL DEFAULT 1 CHECK (priority BETWEEN 0 AND 3), owner TEXT NOT NULL DEFAULT '', waiting_error BLOB, lease_request TEXT, losses INTEGER NOT NULL DEFAULT 0, last_token INTEGER NOT NULL DEFAULT 0, tenant TEXT NOT NULL DEFAULT '', order_level INTEGER NOT NULL DEFAULT 1, trace_parent TEXT, film INTEGER NOT NULL DEFAULT 0,
    CHECK ((state = 'RUNNING') = (lease_deadline IS NOT NULL)),
    CHECK ((state IN ('SUCCEEDED', 'FAILED', 'CANCELLED')) = (end_time IS NOT NULL)),
    CHECK ((kind = 'ingest') = (capture IS NOT NULL)),
    CHECK ((kind = 'ingest') = (model IS NULL))
) STRICT;
CREATE UNIQUE INDEX one_trainer_a_model ON jobs (model) WHERE kind = 'train' AND state = 'RUNNING';
CREATE TABLE "checkpoints" (
    model           TEXT NOT NULL REFERENCES models (id),
    step            INTEGER NOT NULL,
    job             TEXT REFERENCES jobs (id) ON DELETE SET NULL,
    manifest_key    TEXT NOT NULL,
    manifest_bytes  INTEGER NOT NULL,
    manifest_sha256 TEXT NOT NULL,
    bytes           INTEGER NOT NULL,
    psnr            REAL,
    create_time     REAL NOT NULL DEFAULT (unixepoch('subsec')),
    tradeoff_key    TEXT,
    tradeoff_bytes  INTEGER,
    tradeoff_sha256 TEXT,
    slots           TEXT,
    image_size      INTEGER,
    shards          TEXT,
    number          INTEGER NOT NULL,
    PRIMARY KEY (model, step)
) STRICT, WITHOUT ROWID;
CREATE INDEX checkpoints_of_job ON checkpoints (job);
CREATE TABLE garbage (
    folder     TEXT PRIMARY KEY,
    deleted    INTEGER NOT NULL CHECK (deleted IN (0, 1)),
    garbage_since REAL NOT NULL DEFAULT (unixepoch('subsec'))
) STRICT, WITHOUT ROWID;
CREATE INDEX jobs_of_worker ON jobs (worker);
CREATE TABLE job_captures (
    job     TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    subject TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    PRIMARY KEY (job, subject)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_captures_of_capture ON job_captures (capture);
CREATE INDEX job_captures_of_subject ON job_captures (subject);
CREATE TABLE job_attempts (
    job        TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    lease      INTEGER NOT NULL,
    worker     TEXT NOT NULL REFERENCES workers (id),
    begin_time REAL NOT NULL,
    end_time   REAL,
    outcome    TEXT NOT NULL DEFAULT 'RUNNING',
    error      BLOB, lease_deadline REAL, lease_request TEXT,
    PRIMARY KEY (job, lease),
    CHECK ((outcome = 'RUNNING') = (end_time IS NULL))
) STRICT, WITHOUT ROWID;
CREATE INDEX attempts_of_worker ON job_attempts (worker);
CREATE TABLE job_outputs (
    ord    INTEGER PRIMARY KEY AUTOINCREMENT,
    job    TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    file   TEXT NOT NULL,
    key    TEXT NOT NULL,
    bytes  INTEGER NOT NULL,
    sha256 TEXT NOT NULL,
    UNIQUE (job, file)
) STRICT;
CREATE TABLE lease_clock (
    id        INTEGER PRIMARY KEY CHECK (id = 1),
    last_tick REAL NOT NULL
) STRICT;
CREATE TABLE "captures" (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    subject      TEXT NOT NULL REFERENCES subjects (id),
    state        TEXT NOT NULL DEFAULT 'UPLOADING'
                 CHECK (state IN ('UPLOADING', 'UPLOADED', 'INGESTING', 'READY', 'REJECTED')),
    frames       INTEGER NOT NULL DEFAULT 0,
    width        INTEGER NOT NULL DEFAULT 0,
    height       INTEGER NOT NULL DEFAULT 0,
    shard_key    TEXT,
    shard_bytes  INTEGER,
    shard_sha256 TEXT,
    create_time  REAL NOT NULL DEFAULT (unixepoch('subsec')),
    first_frame  INTEGER,
    last_frame   INTEGER,
    idle_since   REAL NOT NULL DEFAULT (unixepoch('subsec')), writer INTEGER NOT NULL DEFAULT 0, files_removed INTEGER NOT NULL DEFAULT 0 CHECK (files_removed IN (0, 1)),
    CHECK ((state = 'READY') = (shard_key IS NOT NULL))
) STRICT;
CREATE INDEX captures_of_subject ON captures (subject, state);
CREATE INDEX open_uploads ON captures (idle_since) WHERE state = 'UPLOADING';
CREATE TABLE "capture_files" (
    capture   TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    path      TEXT NOT NULL,
    bytes     INTEGER NOT NULL,
    sha256    TEXT NOT NULL,
    committed INTEGER NOT NULL DEFAULT 0 CHECK (committed BETWEEN 0 AND bytes),
    PRIMARY KEY (capture, path)
) STRICT, WITHOUT ROWID;
CREATE INDEX ingests_of_capture ON jobs (capture, ord) WHERE capture IS NOT NULL;
CREATE UNIQUE INDEX one_open_ingest_a_capture ON jobs (capture)
    WHERE capture IS NOT NULL AND state IN ('QUEUED', 'RUNNING');
CREATE INDEX helping ON job_attempts (worker, job, lease) WHERE lease_deadline IS NOT NULL;
CREATE VIEW leases AS
SELECT id AS job, lease AS token, worker, lease_deadline, lease_request
FROM jobs WHERE state = 'RUNNING'
UNION ALL
SELECT job, lease, worker, lease_deadline, lease_request
FROM job_attempts WHERE lease_deadline IS NOT NULL;
CREATE TABLE render_ranges (
    job      TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    first    INTEGER NOT NULL,
    pictures INTEGER NOT NULL CHECK (pictures > 0),
    token    INTEGER,
    drawn    INTEGER NOT NULL DEFAULT 0 CHECK (drawn IN (0, 1)),
    PRIMARY KEY (job, first),
    CHECK (drawn = 0 OR token IS NULL)
) STRICT, WITHOUT ROWID;
CREATE TABLE job_models (
    job   TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    model TEXT NOT NULL REFERENCES models (id) ON DELETE CASCADE,
    step  INTEGER NOT NULL,
    PRIMARY KEY (job, model)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_models_of_model ON job_models (model);
CREATE INDEX jobs_of_model ON jobs (model, ord);
CREATE TABLE service_clock (
    id        INTEGER PRIMARY KEY CHECK (id = 1),
    last_tick REAL NOT NULL
) STRICT;
CREATE TABLE clock_steps (
    ord     INTEGER PRIMARY KEY AUTOINCREMENT,
    at      REAL NOT NULL,
    seconds REAL NOT NULL
) STRICT;
CREATE INDEX subjects_of_tenant ON subjects (tenant);
CREATE INDEX models_of_tenant ON models (tenant);
CREATE INDEX workers_of_tenant ON workers (tenant);
CREATE INDEX jobs_of_tenant ON jobs (tenant);
CREATE INDEX jobs_by_state ON jobs (state, tenant, priority DESC, ord);
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
CREATE TABLE "request_ids" (
    tenant      TEXT NOT NULL,
    method      TEXT NOT NULL,
    request_id  TEXT NOT NULL,
    body_sha256 TEXT NOT NULL,
    answer      TEXT NOT NULL,
    kept_since REAL NOT NULL,
    PRIMARY KEY (tenant, method, request_id)
) STRICT, WITHOUT ROWID;
CREATE TABLE "paused_kinds" (
    tenant TEXT NOT NULL,
    kind   TEXT NOT NULL,
    reason TEXT NOT NULL,
    since  REAL NOT NULL,
    PRIMARY KEY (tenant, kind)
) STRICT, WITHOUT ROWID;
CREATE TABLE job_metrics (
    job     TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    step    INTEGER NOT NULL,
    seconds REAL NOT NULL,
    loss    REAL NOT NULL,
    psnr    REAL,
    ssim    REAL,
    PRIMARY KEY (job, step)
) STRICT, WITHOUT ROWID;
CREATE TABLE capture_objects (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    file    TEXT NOT NULL,
    key     TEXT NOT NULL,
    bytes   INTEGER NOT NULL,
    sha256  TEXT NOT NULL,
    PRIMARY KEY (capture, file)
) STRICT, WITHOUT ROWID;
CREATE INDEX jobs_in_turn ON jobs (state, tenant, kind, priority DESC, ord, owner, model, not_before, order_level);
CREATE TABLE upload_parts (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    writer  INTEGER NOT NULL,
    number  INTEGER NOT NULL,
    key     TEXT NOT NULL,
    bytes   INTEGER NOT NULL CHECK (bytes > 0),
    sha256  TEXT NOT NULL,
    PRIMARY KEY (capture, writer, number)
) STRICT, WITHOUT ROWID;
CREATE TABLE upload_pieces (
    capture    TEXT NOT NULL,
    path       TEXT NOT NULL,
    start      INTEGER NOT NULL CHECK (start >= 0),
    bytes      INTEGER NOT NULL CHECK (bytes > 0),
    writer     INTEGER NOT NULL,
    number     INTEGER NOT NULL,
    part_start INTEGER NOT NULL CHECK (part_start >= 0),
    PRIMARY KEY (capture, path, start),
    FOREIGN KEY (capture, path) REFERENCES capture_files (capture, path) ON DELETE CASCADE,
    FOREIGN KEY (capture, writer, number) REFERENCES upload_parts (capture, writer, number) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
CREATE INDEX pieces_of_parts ON upload_pieces (capture, writer, number, part_start);
CREATE TABLE drains (
    id     INTEGER PRIMARY KEY CHECK (id = 1),
    reason TEXT NOT NULL,
    since  REAL NOT NULL
);
CREATE TABLE cordons (
    tenant TEXT NOT NULL,
    worker TEXT NOT NULL,
    reason TEXT NOT NULL,
    since  REAL NOT NULL,
    PRIMARY KEY (tenant, worker)
);
CREATE TABLE object_store (
    one INTEGER PRIMARY KEY CHECK (one = 1),
    id  TEXT NOT NULL
) STRICT;
CREATE TABLE keys (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    tenant       TEXT NOT NULL,
    display_name TEXT NOT NULL,
    sha256       TEXT NOT NULL UNIQUE,
    scopes       TEXT NOT NULL,
    create_time  REAL NOT NULL,
    expire_time  REAL,
    used_time    REAL,
    revoke_time  REAL
, session INTEGER NOT NULL DEFAULT 0) STRICT;
CREATE INDEX keys_of_tenant ON keys (tenant, ord);
CREATE TABLE consents (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    subject     TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    given_by    TEXT NOT NULL,
    note        TEXT NOT NULL,
    create_time REAL NOT NULL,
    expire_time REAL
) STRICT;
CREATE INDEX consents_of_subject ON consents (subject, ord);
CREATE TABLE consent_purposes (
    consent     TEXT NOT NULL REFERENCES consents (id) ON DELETE CASCADE,
    purpose     TEXT NOT NULL CHECK (purpose IN ('CONSENT_TRAIN', 'CONSENT_RENDER', 'CONSENT_EXPORT', 'CONSENT_SHARE')),
    revoke_time REAL,
    PRIMARY KEY (consent, purpose)
) STRICT, WITHOUT ROWID;
CREATE TABLE erasures (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    subject     TEXT NOT NULL,
    name_sha256 TEXT NOT NULL,
    state       TEXT NOT NULL DEFAULT 'RUNNING' CHECK (state IN ('RUNNING', 'DONE', 'FAILED')),
    create_time REAL NOT NULL,
    end_time    REAL,
    message     TEXT NOT NULL DEFAULT '',
    work        TEXT,
    report      TEXT NOT NULL DEFAULT '',
    signature   TEXT NOT NULL DEFAULT '',
    public_key  TEXT NOT NULL DEFAULT ''
, retrain INTEGER NOT NULL DEFAULT 0) STRICT;
CREATE INDEX erasures_of_tenant ON erasures (tenant, ord);
CREATE UNIQUE INDEX one_erasure_a_person ON erasures (subject);
CREATE TABLE erasure_models (
    erasure TEXT NOT NULL REFERENCES erasures (id) ON DELETE CASCADE,
    model   TEXT NOT NULL REFERENCES models (id) ON DELETE CASCADE,
    job     TEXT NOT NULL, retrained TEXT,
    PRIMARY KEY (erasure, model)
) STRICT, WITHOUT ROWID;
CREATE TABLE quotas (
    tenant         TEXT NOT NULL PRIMARY KEY,
    people         INTEGER CHECK (people >= 0),
    bytes          INTEGER CHECK (bytes >= 0),
    open_jobs      INTEGER CHECK (open_jobs >= 0),
    device_seconds REAL CHECK (device_seconds >= 0),
    pictures       INTEGER CHECK (pictures >= 0)
, calls_per_second REAL CHECK (calls_per_second >= 0)) STRICT, WITHOUT ROWID;
CREATE TABLE work_of_days (
    tenant         TEXT NOT NULL,
    day            INTEGER NOT NULL,
    device_seconds REAL NOT NULL DEFAULT 0,
    pictures       INTEGER NOT NULL DEFAULT 0,
    PRIMARY KEY (tenant, day)
) STRICT, WITHOUT ROWID;
CREATE TABLE audit (
    number  INTEGER PRIMARY KEY,
    time    REAL NOT NULL,
    tenant  TEXT NOT NULL,
    key     TEXT NOT NULL,
    call    TEXT NOT NULL,
    names   TEXT NOT NULL,
    names_sha256 TEXT NOT NULL,
    began   INTEGER,
    outcome TEXT NOT NULL,
    hash    TEXT NOT NULL
) STRICT;
CREATE TABLE shares (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    job         TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    subject     TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    sha256      TEXT NOT NULL UNIQUE,
    note        TEXT NOT NULL,
    embed       INTEGER NOT NULL CHECK (embed IN (0, 1)),
    create_time REAL NOT NULL,
    expire_time REAL,
    revoke_time REAL
) STRICT;
CREATE INDEX shares_of_tenant ON shares (tenant, ord);
CREATE INDEX shares_of_job ON shares (job);
CREATE INDEX shares_of_subject ON shares (subject);
CREATE TABLE webhooks (
    ord         INTEGER PRIMARY KEY,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    url         TEXT NOT NULL,
    secret      TEXT NOT NULL,
    note        TEXT NOT NULL,
    create_time REAL NOT NULL,
    last_time   REAL,
    last_error  TEXT NOT NULL DEFAULT ''
) STRICT;
CREATE INDEX webhooks_of_tenant ON webhooks (tenant, ord);
CREATE TABLE webhook_deliveries (
    ord         INTEGER PRIMARY KEY,
    id          TEXT NOT NULL UNIQUE,
    webhook     TEXT NOT NULL REFERENCES webhooks (id) ON DELETE CASCADE,
    job         TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    attempts    INTEGER NOT NULL DEFAULT 0,
    next_time   REAL NOT NULL
) STRICT;
CREATE INDEX webhook_deliveries_by_time ON webhook_deliveries (next_time);
CREATE INDEX webhook_deliveries_of_webhook ON webhook_deliveries (webhook);
CREATE INDEX webhook_deliveries_of_job ON webhook_deliveries (job);
CREATE TABLE checkpoint_aliases (
    model TEXT NOT NULL,
    alias TEXT NOT NULL,
    step  INTEGER NOT NULL,
    PRIMARY KEY (model, alias),
    FOREIGN KEY (model, step) REFERENCES checkpoints (model, step) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
CREATE INDEX checkpoint_aliases_of_checkpoint ON checkpoint_aliases (model, step);
CREATE TABLE consent_evidence (
    consent   TEXT NOT NULL PRIMARY KEY REFERENCES consents (id) ON DELETE CASCADE,
    file_name TEXT NOT NULL,
    bytes     INTEGER NOT NULL,
    sha256    TEXT NOT NULL,
    content   BLOB NOT NULL
) STRICT, WITHOUT ROWID;

INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) VALUES
    (1, 'init', TRUE, x'3f724159599f40de5a564edde185e3d9fdebc81d840e3a44da1cb36dbdab351aa612102108cc4fce38b23f6c51212246', 1000),
    (2, 'evaluate jobs', TRUE, x'839592eb38d1cdb61532b43cf96984c080d7144e5d8dfe16662decebb0fc39d8d67587c2a81b9d82fb8fa99c970ab1c1', 1000),
    (3, 'tradeoffs', TRUE, x'635b0f3b9fa0b4a8b6169eb3b995a519d39ae3f5bd681972e2c6a047088597a04c8981bd3469a718c9ad735889c66842', 1000),
    (4, 'retries', TRUE, x'7da3876ca8b0ff2d8fb66aedc72270245750e9a86a7afa48483349a12d1e2c1b8b92ea3e634520b9af818b0ae1363a8c', 1000),
    (5, 'trained slots', TRUE, x'f259712559255622f760a462733ba93f09957318d1c1df721bc9d16029c93155fc99255340914a49719702030ee29ea9', 1000),
    (6, 'frame numbers', TRUE, x'1c906afbe9361fa1c610679ceb3e602d5fa35b7bbbeeb207d94d105b98f8bfb8f8efdbae3ac181263bf63068b51c7fa7', 1000),
    (7, 'checkpoint shards', TRUE, x'563dfe7cba23385543e59fcf4d8d56c9d98024abb12eeca8a04b88dde0780410b60a82fe94bbc8391ec565f330a3b500', 1000),
    (8, 'storage', TRUE, x'3088bc43cf8a2fb2b46f0c9b1f380c04f408b3e0968f10f77875abbb860ea9e434fdb5a022239853046b36d170e5732c', 1000),
    (9, 'jobs', TRUE, x'957910777f5c2bf352219b665905b6e78e2cbcbdd5a0477019cb24ab4cd1caf0d8ef111528b7b18d22babdc82d469778', 1000),
    (10, 'uploads', TRUE, x'15bbfbfad50da870bebbc9108a3ccf2a6d8e7c303973131c0def5772695b03e5c35486a823aaa2fab90e97ae8265c413', 1000),
    (11, 'render ranges', TRUE, x'abeb3ec640548fd6efdf3b38b899248fbdcb6e48730bc57ecb0f7047630611de5045e4ea4347c8439420f16d8519cfdf', 1000),
    (12, 'scene models', TRUE, x'2c5122a74f69e523a46a901b5e2f34de215c783b663b1da6e2fd8bd17feb505a9c92cc61fc8b0dd1c41600de4eb6ccf1', 1000),
    (13, 'export jobs', TRUE, x'd735b7f073c8abcf1415bef27fd3f9a0075251254b4b39a25f03ba6c1f544b980b57d571273ff0d369f300ce224afcec', 1000),
    (14, 'clock steps', TRUE, x'77cd83ceb109b9a6703001ee23127b05788605ae7436a30404f58a36a3eed29e020873d8b5f7b18c4078e3f881304c0c', 1000),
    (15, 'tenants', TRUE, x'9f4cb1fe033ff7be9e8098c911a94e9cf7dc11320f934f9e2b1816152028b109b9e11a6f3026161a6dbb416725fdec52', 1000),
    (16, 'stamps', TRUE, x'efbba43ca99c5c4aafaf6a55afb55383f7b7ebd96092f94db5c3b0def485bd4d8ea859ab583d5c8820c07a2adff727b1', 1000),
    (17, 'job metrics', TRUE, x'7c60b77149c17b9da766f5d519be89d6ee1fc0a918b9603afe6dcbacb1b371a4e0325cef55e9c5306c8a562338bda4a4', 1000),
    (18, 'order levels', TRUE, x'1b1c2c0f8fcfda9b553f84a6267cafdb42f5c41a3c051ab431fd00e5452d4f371f115f8db0d348bd5e508c0ba66e2602', 1000),
    (19, 'capture objects', TRUE, x'27d479825c20c8ecf98fb21b720bc6944f18a6774d3a642ce6efffc1635c7579e13ec3458c1c40cd35267392c3473ea0', 1000),
    (21, 'turns of tenants', TRUE, x'a6ca05b108ad809da00190c9ebd13806304ebde3ccc436f35e95dca247e061bd52cd184b6f492a4f408fd47e4338faf9', 1000),
    (22, 'shared state', TRUE, x'a5d5dd0aebcb60dfd550537966918501a09e39d24f86f52306545394d0cdf264ed803d73a828314422d15889956e6fdc', 1000),
    (23, 'upload parts', TRUE, x'73bf3f08897aac23f5bc934e5836f11988ab9748c72dfc0911dfaf18a7f7be5d89326007ee87d1cc5d2ae31bb90b8bf7', 1000),
    (24, 'operators', TRUE, x'f6a4970267045198bc70b51047585454bad7597a81a0ac9dd184d15cbcb305085391fccc1bd929e63cf1f3e717437cda', 1000),
    (25, 'several coordinators', TRUE, x'1233171007c5f51ddc71cbdd75d449563b86782083f29c0019184d87ba042c92f056b80169ff3838e4232157e39d4729', 1000),
    (26, 'keys', TRUE, x'991167305f1dae61c81dea9dc91ec1c77e663e0b19a35744e17803d3d01809da6be97d38f90cbc9911def53eeb9a405f', 1000),
    (27, 'consents', TRUE, x'253681fdf21eef14845da23cd6637738b0c851d1cd89d7e703cddc0e69bf0671e73e8ddeb5f4414b3465115c2a1d6b87', 1000),
    (28, 'traces', TRUE, x'5bde00e8dea3b9df6d39b0a31dab31f669d643e2c3d8670abd553a9788bb558cac54c207a712f42d1cb48b183f526474', 1000),
    (29, 'quotas', TRUE, x'51f998961d11d4f9556a04da3dbd75c007c2bda0ac2ccef8421fdaa94b92c8394b44431303de88927c25e1d3a2357a60', 1000),
    (30, 'audit', TRUE, x'095ce06987392b3d42587de29e09fb622323182be98fea46c4d43bc110e94e6429bec4569726d3a3574264b60bf6d6cb', 1000),
    (31, 'shares', TRUE, x'a82f735b16523589f135ce6a795a07258aec886a8c9a192ae0348a55e299fa6e25e5615c68bff6bd38f797e7d0fa7158', 1000),
    (32, 'films', TRUE, x'14e1f29a3d4fa747029f574a7e3c79b1d95d4ef7b1c75ca974a268cd32f50813321b78ef761fd4fcc32f0b1369581dd5', 1000),
    (33, 'webhooks', TRUE, x'b37aec947d7bd285ea39a7287dbe2879afaee20b37797b27da57ae4fedb520a32f695ebcfe853a0129ecdc1e700524f6', 1000),
    (34, 'rates', TRUE, x'35179347e21816e445905007aa994c25aea9d21e5d591671216761f1512687480a2e7e028d5125c633f9ba1fe8f57fc8', 1000),
    (35, 'retraining', TRUE, x'c0f3b86812462599fa47790b7f44a87159aa174e1a9dfeb4bacac78800a2889a01499983f7f791e7a72c0688da502152', 1000),
    (36, 'aliases', TRUE, x'4ea873a82ab455f438ace63a86c0ef4f411b42dad8b63da05fa8f40ca6fa19335dcf6898fa2b2cfae797fb52c693ce22', 1000),
    (37, 'evidence', TRUE, x'cdd2d40b2b528224e8bc0d25660169bdea18a05d4c9813b93f67ad0ccbab90b80046c81edff09b5df47d16aae97ebc69', 1000),
    (38, 'sessions', TRUE, x'6d3e6babe0b6c7f0c8363a17e1311155b8301c53bcd2371da2948ff9538f09f49fbaea30086de3d50f52430818816af0', 1000);

INSERT INTO subjects (id, display_name, consent_note, create_time, tenant) VALUES
    ('s', 'Ada', 'a note', 1.5, 'default'),
    ('t', 'Eve', '', 1.5, 'other');
INSERT INTO consents (id, subject, given_by, note, create_time, expire_time) VALUES
    ('n', 's', '', 'filmed on Monday', 1.5, NULL);
INSERT INTO consent_purposes (consent, purpose, revoke_time) VALUES
    ('n', 'CONSENT_TRAIN', NULL),
    ('n', 'CONSENT_RENDER', 1.75);
INSERT INTO consent_evidence (consent, file_name, bytes, sha256, content) VALUES
    ('n', 'form.pdf', 4, 'e', x'25504446');
INSERT INTO captures (id, subject, state, frames, width, height, shard_key, shard_bytes, shard_sha256, create_time, first_frame, last_frame, idle_since, writer, files_removed) VALUES
    ('c', 's', 'READY', 2, 64, 96, 'k', 1, 'x', 1.5, 0, 1, 1.5, 2, 1),
    ('open', 's', 'UPLOADING', 0, 0, 0, NULL, NULL, NULL, 1.5, NULL, NULL, 1.5, 3, 0),
    ('read', 's', 'INGESTING', 0, 0, 0, NULL, NULL, NULL, 1.5, NULL, NULL, 1.5, 5, 0),
    ('gone', 's', 'REJECTED', 0, 0, 0, NULL, NULL, NULL, 1.5, NULL, NULL, 1.5, 1, 1);
INSERT INTO capture_files (capture, path, bytes, sha256, committed) VALUES
    ('c', 'poses.json', 2, 'x', 2),
    ('gone', 'poses.json', 2, 'x', 2),
    ('open', 'poses.json', 2, 'p', 2),
    ('open', 'video.mp4', 10, 'v', 4),
    ('open', 'z', 5, 'z', 0),
    ('read', 'poses.json', 2, 'x', 2);
INSERT INTO upload_parts (capture, writer, number, key, bytes, sha256) VALUES
    ('open', 0, 1, 'uploads/open/poses.json', 2, 'p'),
    ('open', 0, 2, 'uploads/open/video.mp4', 4, ''),
    ('read', 0, 1, 'uploads/read/poses.json', 2, 'x');
INSERT INTO upload_pieces (capture, path, start, bytes, writer, number, part_start) VALUES
    ('open', 'poses.json', 0, 2, 0, 1, 0),
    ('open', 'video.mp4', 0, 4, 0, 2, 0),
    ('read', 'poses.json', 0, 2, 0, 1, 0);
INSERT INTO capture_violations (capture, number, code, file, frame, field, message) VALUES
    ('gone', 1, 'TOO_FEW_FRAMES', 'poses.json', NULL, 'frames', 'there is one frame');
INSERT INTO capture_objects (capture, file, key, bytes, sha256) VALUES
    ('c', 'report.json', 'captures/c/report.json', 1, 'x');
INSERT INTO models (id, display_name, tier, variant, next_slot, create_time, keep_newest, keep_every, published, tenant) VALUES
    ('m', 'm', 'draft', 'yoto', 1, 1.5, 2, NULL, 1, 'default'),
    ('m2', 'm2', 'draft', 'yoto', 0, 1.5, NULL, NULL, 0, 'default');
INSERT INTO slots (model, slot, subject) VALUES
    ('m', 0, 's');
INSERT INTO keys (id, tenant, display_name, sha256, scopes, create_time, expire_time, used_time, revoke_time, session) VALUES
    ('key', 'default', 'ci', '2c70e12b7a0646f92279f427c7b38e7334d8e5389cff167a1dc30e73f826b683', 'SCOPE_READ SCOPE_WORK', 1.5, NULL, 1.75, NULL, 0);
INSERT INTO workers (id, display_name, backend, adapter, gpu, memory_bytes, create_time, embedded, tenant, order_level, version, asked_time, instance, key, reads_films) VALUES
    ('w', 'w', 'cpu', 'cpu', 0, 0, 1.5, 0, 'default', 0, '', 1.5, NULL, NULL, 0),
    ('v', 'v', 'wgpu', 'a GPU', 1, 1000000000, 1.5, 0, 'default', 1, '0.1.0', 1.5, NULL, 'key', 1);
INSERT INTO worker_kinds (worker, kind) VALUES
    ('w', 'render'),
    ('w', 'train');
INSERT INTO cordons (tenant, worker, reason, since) VALUES
    ('default', 'broken', 'no memory', 1.5);
INSERT INTO jobs (id, kind, capture, model, state, spec, progress, result, error, lease, lease_deadline, lost_workers, cancel_requested, worker, sequence, create_time, start_time, end_time, retries, not_before, pinned_step, priority, owner, waiting_error, lease_request, losses, last_token, tenant, order_level, trace_parent, film) VALUES
    ('x', 'export', NULL, 'm', 'SUCCEEDED', x'', NULL, NULL, NULL, 3, NULL, 0, 0, 'w', 4, 1.5, 1.5, 1.75, 0, NULL, 3, 1, '', NULL, NULL, 0, 3, 'default', 1, NULL, 0),
    ('r', 'render', NULL, 'm', 'SUCCEEDED', x'', x'', x'', NULL, 9, NULL, 1, 0, 'w', 4, 1.5, 1.5, 1.75, 1, 1.5, 3, 1, 'ada', NULL, 'q', 1, 9, 'default', 1, '00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01', 0),
    ('j', 'train', NULL, 'm', 'RUNNING', x'120a0a086d6f64656c732f6d', NULL, NULL, NULL, 77, 10000000000.0, 0, 0, 'w', 2, 1.5, 1.5, NULL, 0, NULL, NULL, 2, 'ada', NULL, 'lr', 0, 77, 'default', 1, NULL, 0),
    ('i', 'ingest', 'read', NULL, 'QUEUED', x'0a0f0a0d63617074757265732f72656164', NULL, NULL, NULL, 0, NULL, 0, 0, NULL, 1, 1.5, NULL, NULL, 0, NULL, NULL, 1, '', NULL, NULL, 0, 0, 'default', 1, NULL, 0);
INSERT INTO job_captures (job, subject, capture) VALUES
    ('j', 's', 'c');
INSERT INTO job_models (job, model, step) VALUES
    ('r', 'm2', 7);
INSERT INTO job_attempts (job, lease, worker, begin_time, end_time, outcome, error, lease_deadline, lease_request) VALUES
    ('j', 77, 'w', 1.5, NULL, 'RUNNING', NULL, NULL, NULL),
    ('r', 9, 'w', 1.5, 1.75, 'SUCCEEDED', NULL, NULL, NULL);
INSERT INTO render_ranges (job, first, pictures, token, drawn) VALUES
    ('r', 0, 10, NULL, 1);
INSERT INTO job_outputs (job, file, key, bytes, sha256) VALUES
    ('r', '000000.png', 'jobs/r/000000.png', 1, 'x');
INSERT INTO job_metrics (job, step, seconds, loss, psnr, ssim) VALUES
    ('j', 10, 1.5, 0.25, 20.5, 0.75);
INSERT INTO paused_kinds (tenant, kind, reason, since) VALUES
    ('default', 'export', 'later', 1.5);
INSERT INTO drains (id, reason, since) VALUES
    (1, 'upgrade', 1.5);
INSERT INTO checkpoints (model, step, job, manifest_key, manifest_bytes, manifest_sha256, bytes, psnr, create_time, tradeoff_key, tradeoff_bytes, tradeoff_sha256, slots, image_size, shards, number) VALUES
    ('m', 3, 'j', 'models/m/3/manifest.json', 1, 'x', 1, 20.5, 1.5, 'models/m/3/tradeoff.json', 1, 'x', '0', 64, 'x', 1);
INSERT INTO checkpoint_aliases (model, alias, step) VALUES
    ('m', 'best', 3);
INSERT INTO shares (id, tenant, job, subject, sha256, note, embed, create_time, expire_time, revoke_time) VALUES
    ('h', 'default', 'x', 's', '9c2e', '', 0, 1.5, NULL, NULL);
INSERT INTO webhooks (id, tenant, url, secret, note, create_time, last_time, last_error) VALUES
    ('wh', 'default', 'https://example.org/hook', 'secret', '', 1.5, NULL, '');
INSERT INTO webhook_deliveries (id, webhook, job, attempts, next_time) VALUES
    ('d', 'wh', 'r', 0, 1.5);
INSERT INTO erasures (id, tenant, subject, name_sha256, state, create_time, end_time, message, work, report, signature, public_key, retrain) VALUES
    ('e', 'default', 'nobody', '5d41', 'DONE', 1.5, 1.75, '', NULL, '{}', 's', 'p', 1);
INSERT INTO erasure_models (erasure, model, job, retrained) VALUES
    ('e', 'm2', 'x', 'm3');
INSERT INTO quotas (tenant, people, bytes, open_jobs, device_seconds, pictures, calls_per_second) VALUES
    ('default', 10, 1000000000, 100, 1000000.5, NULL, 50.0);
INSERT INTO work_of_days (tenant, day, device_seconds, pictures) VALUES
    ('default', 20000, 12.5, 10);
INSERT INTO request_ids (tenant, method, request_id, body_sha256, answer, kept_since) VALUES
    ('default', 'CreateModel', 'q', 'b', 'm', 1.5);
INSERT INTO audit (number, time, tenant, key, call, names, names_sha256, began, outcome, hash) VALUES
    (1, 1.5, 'default', 'key', 'CreateModel', 'models/m', 'x', NULL, '', 'h1'),
    (2, 1.5, 'default', 'key', 'CreateModel', '', 'y', 1, 'OK', 'h2');
INSERT INTO object_store (one, id) VALUES
    (1, '8d0e6f5c-0000-4000-8000-000000000000');
INSERT INTO garbage (folder, deleted, garbage_since) VALUES
    ('models/old', 1, 1.5);
INSERT INTO lease_clock (id, last_tick) VALUES
    (1, 1.5);
INSERT INTO service_clock (id, last_tick) VALUES
    (1, 1.5);
INSERT INTO clock_steps (at, seconds) VALUES
    (1.0, 0.5);
