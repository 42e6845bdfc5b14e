-- Several coordinators share a database if they share its store of objects: see SQLite's step of this number.
CREATE TABLE object_store (
    one BIGINT PRIMARY KEY CHECK (one = 1),
    id  TEXT NOT NULL
);
ALTER TABLE workers ADD COLUMN instance TEXT;
