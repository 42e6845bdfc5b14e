-- The bytes of uploads are objects that are written once: a part has what was committed at once, and pieces say where the
-- bytes of each file are. The files of uploads that an earlier version began become parts of writer 0.
CREATE TABLE upload_parts (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    -- The writer that has committed it, and its number among that writer's commits. In this order, the parts have the bytes
    -- of each file in their order.
    writer  INTEGER NOT NULL,
    number  INTEGER NOT NULL,
    key     TEXT NOT NULL,
    -- The object of a file that was not complete may have more.
    bytes   INTEGER NOT NULL CHECK (bytes > 0),
    -- Empty for a file that was not complete.
    sha256  TEXT NOT NULL,
    PRIMARY KEY (capture, writer, number)
) STRICT, WITHOUT ROWID;
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

INSERT INTO upload_parts (capture, writer, number, key, bytes, sha256)
SELECT f.capture, 0, row_number() OVER (PARTITION BY f.capture ORDER BY f.path),
       'uploads/' || f.capture || '/' || f.path, f.committed,
       CASE WHEN f.committed = f.bytes THEN f.sha256 ELSE '' END
FROM capture_files f JOIN captures c ON c.id = f.capture
WHERE f.committed > 0 AND c.state <> 'READY' AND c.files_removed = 0;
INSERT INTO upload_pieces (capture, path, start, bytes, writer, number, part_start)
SELECT p.capture, f.path, 0, p.bytes, 0, p.number, 0
FROM upload_parts p JOIN capture_files f
    ON f.capture = p.capture AND p.key = 'uploads/' || f.capture || '/' || f.path;
