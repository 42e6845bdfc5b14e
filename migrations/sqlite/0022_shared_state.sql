-- What several coordinators of one database have to know of each other.

-- When the worker last asked for a job, noted at most every half minute.
ALTER TABLE workers ADD COLUMN asked_time REAL;
-- The number of calls that took over this upload: only the newest of them commits.
ALTER TABLE captures ADD COLUMN writer INTEGER NOT NULL DEFAULT 0;
-- Whether the uploaded files were removed, or are being removed.
ALTER TABLE captures ADD COLUMN files_removed INTEGER NOT NULL DEFAULT 0 CHECK (files_removed IN (0, 1));
