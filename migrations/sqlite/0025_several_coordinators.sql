-- Several coordinators share a database if they share its store of objects.
-- The store in which the objects of these rows are.
CREATE TABLE object_store (
    one INTEGER PRIMARY KEY CHECK (one = 1),
    id  TEXT NOT NULL
) STRICT;
-- The coordinator in whose process the worker runs; none for others, and for those of an earlier version.
ALTER TABLE workers ADD COLUMN instance TEXT;
