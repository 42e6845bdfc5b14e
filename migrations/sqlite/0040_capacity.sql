-- What may be removed of the audit log: entries of before a time, of which the last one's number and hash stay. The chain begins after it.
CREATE TABLE audit_cut (
    one    INTEGER PRIMARY KEY CHECK (one = 1),
    number INTEGER NOT NULL,
    hash   TEXT NOT NULL
) STRICT;

-- The due deliveries of one webhook, so that the share of each is taken by itself.
DROP INDEX webhook_deliveries_of_webhook;
CREATE INDEX webhook_deliveries_of_webhook ON webhook_deliveries (webhook, next_time);

-- Id of the key that has said so; empty: none was asked for.
ALTER TABLE paused_kinds ADD COLUMN by_key TEXT NOT NULL DEFAULT '';
ALTER TABLE drains ADD COLUMN by_key TEXT NOT NULL DEFAULT '';
ALTER TABLE cordons ADD COLUMN by_key TEXT NOT NULL DEFAULT '';
