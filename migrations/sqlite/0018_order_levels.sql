-- Which orders a worker understands: a job goes only to workers of its level or a higher one. Workers that registered before
-- this have none. All orders up to now have the first level.
ALTER TABLE jobs ADD COLUMN order_level INTEGER NOT NULL DEFAULT 1;
ALTER TABLE workers ADD COLUMN order_level INTEGER NOT NULL DEFAULT 0;
-- The worker's version, for people.
ALTER TABLE workers ADD COLUMN version TEXT NOT NULL DEFAULT '';
-- Covers the search for the next job, as before.
DROP INDEX jobs_in_turn;
CREATE INDEX jobs_in_turn ON jobs (state, kind, priority DESC, ord, owner, model, not_before, order_level);
