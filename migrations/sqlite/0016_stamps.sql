-- A time stamp that no user sees, and from which the age of its row counts, is called `…_since`: whatever is called so is
-- corrected when the clock is set back.
ALTER TABLE captures RENAME COLUMN write_time TO idle_since;
ALTER TABLE garbage RENAME COLUMN first_seen TO garbage_since;
ALTER TABLE request_ids RENAME COLUMN create_time TO kept_since;
