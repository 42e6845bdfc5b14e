-- What people have agreed to. A record stays after it was revoked or has run out: it is what stops jobs then.
CREATE TABLE consents (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    subject     TEXT NOT NULL REFERENCES subjects (id) ON DELETE CASCADE,
    -- Who gave it; empty: the person.
    given_by    TEXT NOT NULL,
    note        TEXT NOT NULL,
    create_time REAL NOT NULL,
    -- NULL: it does not run out.
    expire_time REAL
) STRICT;
CREATE INDEX consents_of_subject ON consents (subject, ord);
CREATE TABLE consent_purposes (
    consent     TEXT NOT NULL REFERENCES consents (id) ON DELETE CASCADE,
    purpose     TEXT NOT NULL CHECK (purpose IN ('CONSENT_TRAIN', 'CONSENT_RENDER', 'CONSENT_EXPORT', 'CONSENT_SHARE')),
    revoke_time REAL,
    PRIMARY KEY (consent, purpose)
) STRICT, WITHOUT ROWID;

-- Removals of people. A row stays, without the person's name.
CREATE TABLE erasures (
    ord         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    -- The person's id, whose row is gone in the end.
    subject     TEXT NOT NULL,
    name_sha256 TEXT NOT NULL,
    state       TEXT NOT NULL DEFAULT 'RUNNING' CHECK (state IN ('RUNNING', 'DONE', 'FAILED')),
    create_time REAL NOT NULL,
    end_time    REAL,
    message     TEXT NOT NULL DEFAULT '',
    -- JSON: what was removed from the rows and is to be removed from the store. NULL before and after that.
    work        TEXT,
    report      TEXT NOT NULL DEFAULT '',
    signature   TEXT NOT NULL DEFAULT '',
    public_key  TEXT NOT NULL DEFAULT ''
) STRICT;
CREATE INDEX erasures_of_tenant ON erasures (tenant, ord);
CREATE UNIQUE INDEX one_erasure_a_person ON erasures (subject);
-- The job that takes the person of an erasure out of a model.
CREATE TABLE erasure_models (
    erasure TEXT NOT NULL REFERENCES erasures (id) ON DELETE CASCADE,
    model   TEXT NOT NULL REFERENCES models (id) ON DELETE CASCADE,
    job     TEXT NOT NULL,
    PRIMARY KEY (erasure, model)
) STRICT, WITHOUT ROWID;
