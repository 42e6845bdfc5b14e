-- The bytes of uploads as objects that are written once: see SQLite's step of this number.
CREATE TABLE upload_parts (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    writer  BIGINT NOT NULL,
    number  BIGINT NOT NULL,
    key     TEXT NOT NULL,
    bytes   BIGINT NOT NULL CHECK (bytes > 0),
    sha256  TEXT NOT NULL,
    PRIMARY KEY (capture, writer, number)
);
CREATE TABLE upload_pieces (
    capture    TEXT NOT NULL,
    path       TEXT COLLATE "C" NOT NULL,
    start      BIGINT NOT NULL CHECK (start >= 0),
    bytes      BIGINT NOT NULL CHECK (bytes > 0),
    writer     BIGINT NOT NULL,
    number     BIGINT NOT NULL,
    part_start BIGINT NOT NULL CHECK (part_start >= 0),
    PRIMARY KEY (capture, path, start),
    FOREIGN KEY (capture, path) REFERENCES capture_files (capture, path) ON DELETE CASCADE,
    FOREIGN KEY (capture, writer, number) REFERENCES upload_parts (capture, writer, number) ON DELETE CASCADE
);
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
