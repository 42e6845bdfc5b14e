-- Addresses that are told when jobs end, and what they are still to be told.
CREATE TABLE webhooks (
    ord         INTEGER PRIMARY KEY,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    url         TEXT NOT NULL,
    -- The secret itself: signatures are made with it.
    secret      TEXT NOT NULL,
    note        TEXT NOT NULL,
    create_time REAL NOT NULL,
    last_time   REAL,
    last_error  TEXT NOT NULL DEFAULT ''
) STRICT;
CREATE INDEX webhooks_of_tenant ON webhooks (tenant, ord);
CREATE TABLE webhook_deliveries (
    ord         INTEGER PRIMARY KEY,
    id          TEXT NOT NULL UNIQUE,
    webhook     TEXT NOT NULL REFERENCES webhooks (id) ON DELETE CASCADE,
    job         TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    attempts    INTEGER NOT NULL DEFAULT 0,
    -- No coordinator tries before this time; one that tries now has moved it.
    next_time   REAL NOT NULL
) STRICT;
CREATE INDEX webhook_deliveries_by_time ON webhook_deliveries (next_time);
CREATE INDEX webhook_deliveries_of_webhook ON webhook_deliveries (webhook);
CREATE INDEX webhook_deliveries_of_job ON webhook_deliveries (job);
