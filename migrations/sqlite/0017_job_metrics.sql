-- Figures of a training over its steps, thinned, so that a curve can be drawn. `psnr` and `ssim` are on held-out frames, and
-- only in the points at which they were measured.
CREATE TABLE job_metrics (
    job     TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    step    INTEGER NOT NULL,
    seconds REAL NOT NULL,
    loss    REAL NOT NULL,
    psnr    REAL,
    ssim    REAL,
    PRIMARY KEY (job, step)
) STRICT, WITHOUT ROWID;
