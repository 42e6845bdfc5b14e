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
