-- SHA-256 of the shards that a checkpoint was trained on, separated by commas; NULL for earlier ones.
ALTER TABLE checkpoints ADD COLUMN shards TEXT;
