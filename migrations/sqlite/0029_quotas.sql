-- What a tenant may use at most. NULL, and a tenant without a row: no limit.
CREATE TABLE quotas (
    tenant         TEXT NOT NULL PRIMARY KEY,
    people         INTEGER CHECK (people >= 0),
    bytes          INTEGER CHECK (bytes >= 0),
    open_jobs      INTEGER CHECK (open_jobs >= 0),
    device_seconds REAL CHECK (device_seconds >= 0),
    pictures       INTEGER CHECK (pictures >= 0)
) STRICT, WITHOUT ROWID;

-- What workers have done for a tenant on each day, so that deletion of a job takes nothing back.
CREATE TABLE work_of_days (
    tenant         TEXT NOT NULL,
    -- Days since 1970, UTC.
    day            INTEGER NOT NULL,
    device_seconds REAL NOT NULL DEFAULT 0,
    pictures       INTEGER NOT NULL DEFAULT 0,
    PRIMARY KEY (tenant, day)
) STRICT, WITHOUT ROWID;
