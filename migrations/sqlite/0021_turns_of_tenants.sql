-- Covers the search for the next job of a tenant, with all that 0015 and 0018 added to it.
DROP INDEX jobs_in_turn;
CREATE INDEX jobs_in_turn ON jobs (state, tenant, kind, priority DESC, ord, owner, model, not_before, order_level);
