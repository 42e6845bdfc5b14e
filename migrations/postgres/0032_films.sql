-- Films without poses, which only workers with a pose model ingest.
ALTER TABLE workers ADD COLUMN reads_films BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN film BIGINT NOT NULL DEFAULT 0;
