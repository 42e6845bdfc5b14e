-- A checkpoint's measured trade of seconds for fidelity: the object that holds its curve.
-- The three are set together; replacing the checkpoint clears them with it.
ALTER TABLE checkpoints ADD COLUMN tradeoff_key TEXT;
ALTER TABLE checkpoints ADD COLUMN tradeoff_bytes INTEGER;
ALTER TABLE checkpoints ADD COLUMN tradeoff_sha256 TEXT;
