-- What tenants may use at most, and what workers have done for them: see SQLite's step of this number.
CREATE TABLE quotas (
    tenant         TEXT NOT NULL PRIMARY KEY,
    people         BIGINT CHECK (people >= 0),
    bytes          BIGINT CHECK (bytes >= 0),
    open_jobs      BIGINT CHECK (open_jobs >= 0),
    device_seconds DOUBLE PRECISION CHECK (device_seconds >= 0),
    pictures       BIGINT CHECK (pictures >= 0)
);
CREATE TABLE work_of_days (
    tenant         TEXT NOT NULL,
    day            BIGINT NOT NULL,
    device_seconds DOUBLE PRECISION NOT NULL DEFAULT 0,
    pictures       BIGINT NOT NULL DEFAULT 0,
    PRIMARY KEY (tenant, day)
);
