-- What a capture's ingest job made for people: the check's report and a thumbnail, in the folder of its shard. Captures that
-- earlier versions read have none.
CREATE TABLE capture_objects (
    capture TEXT NOT NULL REFERENCES captures (id) ON DELETE CASCADE,
    file    TEXT NOT NULL,
    key     TEXT NOT NULL,
    bytes   INTEGER NOT NULL,
    sha256  TEXT NOT NULL,
    PRIMARY KEY (capture, file)
) STRICT, WITHOUT ROWID;
