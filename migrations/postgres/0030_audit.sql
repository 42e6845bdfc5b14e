-- Who has called what that changes something: see SQLite's step of this number.
CREATE TABLE audit (
    number  BIGINT PRIMARY KEY,
    time    DOUBLE PRECISION NOT NULL,
    tenant  TEXT NOT NULL,
    key     TEXT NOT NULL,
    call    TEXT NOT NULL,
    names   TEXT NOT NULL,
    names_sha256 TEXT NOT NULL,
    began   BIGINT,
    outcome TEXT NOT NULL,
    hash    TEXT NOT NULL
);
