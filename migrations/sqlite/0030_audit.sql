-- Who has called what that changes something: an entry before the call, and one after it. Each has the hash of all entries up to
-- it (server/src/audit/chain.rs).
CREATE TABLE audit (
    number  INTEGER PRIMARY KEY,
    time    REAL NOT NULL,
    tenant  TEXT NOT NULL,
    -- Id of the caller's key; empty: none was asked for.
    key     TEXT NOT NULL,
    call    TEXT NOT NULL,
    -- Names of resources, with spaces between them; an erasure empties it, and leaves the SHA-256 of what it was.
    names   TEXT NOT NULL,
    names_sha256 TEXT NOT NULL,
    -- Number of the entry before the call; NULL in that entry.
    began   INTEGER,
    outcome TEXT NOT NULL,
    hash    TEXT NOT NULL
) STRICT;
