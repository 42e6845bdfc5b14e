-- Numbers of a READY capture's first and last frame; NULL for captures that were read before.
ALTER TABLE captures ADD COLUMN first_frame INTEGER;
ALTER TABLE captures ADD COLUMN last_frame INTEGER;
