-- Which checkpoints a model keeps (NULL: the service's default), and how many were published of it.
ALTER TABLE models ADD COLUMN keep_newest INTEGER;
ALTER TABLE models ADD COLUMN keep_every INTEGER;
ALTER TABLE models ADD COLUMN published INTEGER NOT NULL DEFAULT 0;

-- Step of the checkpoint that a render or evaluate job uses, which is kept while the job is open; NULL
-- for jobs of earlier versions, which do not say.
ALTER TABLE jobs ADD COLUMN pinned_step INTEGER;

-- A checkpoint outlives the row of its job. `number`: it was the so many-th that was published of its
-- model. SQLite can't alter a reference, so the table is made anew; no other one refers to it.
CREATE TABLE checkpoints_2 (
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
INSERT INTO checkpoints_2
SELECT model, step, job, manifest_key, manifest_bytes, manifest_sha256, bytes, psnr, create_time,
       tradeoff_key, tradeoff_bytes, tradeoff_sha256, slots, image_size, shards,
       row_number() OVER (PARTITION BY model ORDER BY step)
FROM checkpoints;
DROP TABLE checkpoints;
ALTER TABLE checkpoints_2 RENAME TO checkpoints;
CREATE INDEX checkpoints_of_job ON checkpoints (job);
UPDATE models SET published = (SELECT count(*) FROM checkpoints c WHERE c.model = models.id);

-- Folders of the object store that nothing refers to any more, since `first_seen`. `deleted`: they
-- belonged to something that was deleted, and everything below them is garbage as well.
CREATE TABLE garbage (
    folder     TEXT PRIMARY KEY,
    deleted    INTEGER NOT NULL CHECK (deleted IN (0, 1)),
    first_seen REAL NOT NULL DEFAULT (unixepoch('subsec'))
) STRICT, WITHOUT ROWID;
