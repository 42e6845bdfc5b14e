-- Links to pages of exports. A row goes with its job or its person.
CREATE TABLE shares (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    job         TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    subject     TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    -- Of the link's secret, lower-case hex.
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
