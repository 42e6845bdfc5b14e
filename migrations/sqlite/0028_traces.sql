-- The header `traceparent` of the call that queued the job; NULL: it had none.
ALTER TABLE jobs ADD COLUMN trace_parent TEXT;
