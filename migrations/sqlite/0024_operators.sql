-- What operators say of the service and of its workers.

-- While there is a row, the service takes no new jobs and gives no leases.
CREATE TABLE drains (
    id     INTEGER PRIMARY KEY CHECK (id = 1),
    reason TEXT NOT NULL,
    since  REAL NOT NULL
);
-- Workers with these display names get no leases, also after they have registered again.
CREATE TABLE cordons (
    tenant TEXT NOT NULL,
    worker TEXT NOT NULL,
    reason TEXT NOT NULL,
    since  REAL NOT NULL,
    PRIMARY KEY (tenant, worker)
);
