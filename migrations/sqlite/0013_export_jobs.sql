-- Jobs and workers learn the kind 'export'. SQLite can't alter a CHECK, but one that allows more changes nothing of
-- the rows: only the texts of both tables are written anew, in the order of
-- https://sqlite.org/lang_altertable.html#otheralter. That is a setting of the connection and not of a
-- transaction, so this script runs without one around it and brings its own; run twice, it changes nothing
-- more.
PRAGMA writable_schema = ON;
BEGIN IMMEDIATE;

UPDATE sqlite_schema
SET sql = replace(sql, '''render'', ''evaluate'')', '''render'', ''evaluate'', ''export'')')
WHERE type = 'table' AND name IN ('jobs', 'worker_kinds');

-- With an index made anew, the schema has a new version, by which all connections read the texts again.
DROP INDEX jobs_of_model;
CREATE INDEX jobs_of_model ON jobs (model, ord);

COMMIT;
PRAGMA writable_schema = RESET;
