-- Keys that the service makes for people who sign in: 1 for them, 0 for others.
ALTER TABLE keys ADD COLUMN session BIGINT NOT NULL DEFAULT 0;
