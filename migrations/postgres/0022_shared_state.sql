-- What several coordinators of one database have to know of each other: see SQLite's step of this number.
ALTER TABLE workers ADD COLUMN asked_time DOUBLE PRECISION;
ALTER TABLE captures ADD COLUMN writer BIGINT NOT NULL DEFAULT 0;
ALTER TABLE captures ADD COLUMN files_removed BIGINT NOT NULL DEFAULT 0 CHECK (files_removed IN (0, 1));
