-- Files that prove consents. They are small, and go with the consent.
CREATE TABLE consent_evidence (
    consent   TEXT NOT NULL PRIMARY KEY REFERENCES consents (id) ON DELETE CASCADE,
    file_name TEXT NOT NULL,
    bytes     BIGINT NOT NULL,
    sha256    TEXT NOT NULL,
    content   BYTEA NOT NULL
);
