-- Keys of callers. A row stays after its key was revoked or has expired: from the first key on, the service asks for one.
CREATE TABLE keys (
    ord          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT NOT NULL UNIQUE,
    tenant       TEXT NOT NULL,
    display_name TEXT NOT NULL,
    -- Of the whole key, lower-case hex.
    sha256       TEXT NOT NULL UNIQUE,
    -- Names of scopes with spaces between them.
    scopes       TEXT NOT NULL,
    create_time  REAL NOT NULL,
    expire_time  REAL,
    used_time    REAL,
    revoke_time  REAL
) STRICT;
CREATE INDEX keys_of_tenant ON keys (tenant, ord);
-- The key with which the worker has registered; none where no key was asked for.
ALTER TABLE workers ADD COLUMN key TEXT REFERENCES keys (id);
