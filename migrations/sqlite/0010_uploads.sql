-- Uploads are resumed: their files are known from the beginning, with what was committed of each, and
-- their time of the last write decides when they end by themselves. Captures learn the state 'UPLOADED',
-- and several ingest jobs, one after another.
--
-- SQLite can't alter a CHECK, so two tables are made anew as in 0002; run twice, this changes nothing more.
PRAGMA foreign_keys = OFF;
BEGIN IMMEDIATE;

DROP VIEW IF EXISTS subject_catalogue;

CREATE TABLE captures_2 (
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
    write_time   REAL NOT NULL DEFAULT (unixepoch('subsec')),
    CHECK ((state = 'READY') = (shard_key IS NOT NULL))
) STRICT;
INSERT INTO captures_2 (ord, id, subject, state, frames, width, height, shard_key, shard_bytes,
                        shard_sha256, create_time, first_frame, last_frame)
SELECT ord, id, subject, state, frames, width, height, shard_key, shard_bytes,
       shard_sha256, create_time, first_frame, last_frame
FROM captures;
DROP TABLE captures;
ALTER TABLE captures_2 RENAME TO captures;
CREATE INDEX captures_of_subject ON captures (subject, state);
CREATE INDEX open_uploads ON captures (write_time) WHERE state = 'UPLOADING';

CREATE TABLE capture_files_2 (
    capture   TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    path      TEXT NOT NULL,
    bytes     INTEGER NOT NULL,
    sha256    TEXT NOT NULL,
    committed INTEGER NOT NULL DEFAULT 0 CHECK (committed BETWEEN 0 AND bytes),
    PRIMARY KEY (capture, path)
) STRICT, WITHOUT ROWID;
INSERT INTO capture_files_2 SELECT capture, path, bytes, sha256, bytes FROM capture_files;
DROP TABLE capture_files;
ALTER TABLE capture_files_2 RENAME TO capture_files;

-- A subject's state follows from its captures, so the two can never disagree.
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

-- One ingest job of a capture is open at a time.
DROP INDEX IF EXISTS one_ingest_a_capture;
CREATE INDEX IF NOT EXISTS ingests_of_capture ON jobs (capture, ord) WHERE capture IS NOT NULL;
CREATE UNIQUE INDEX IF NOT EXISTS one_open_ingest_a_capture ON jobs (capture)
    WHERE capture IS NOT NULL AND state IN ('QUEUED', 'RUNNING');

COMMIT;
PRAGMA foreign_keys = ON;
