-- Calls per second of a tenant; NULL: no limit.
ALTER TABLE quotas ADD COLUMN calls_per_second REAL CHECK (calls_per_second >= 0);
