-- A job that failed through no fault of its own waits until `not_before` and is tried again;
-- `retries` counts how often it was.
ALTER TABLE jobs ADD COLUMN retries INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN not_before REAL;
