-- Slots that a checkpoint was trained with, separated by commas, and the longest side of its training
-- images, pixels (0: the captures' own); NULL for earlier checkpoints, which do not say.
ALTER TABLE checkpoints ADD COLUMN slots TEXT;
ALTER TABLE checkpoints ADD COLUMN image_size INTEGER;
