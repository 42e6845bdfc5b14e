-- Checkpoints of other models that a render uses: people of a scene may be of several. That of the job's own
-- model is `jobs.pinned_step`.
CREATE TABLE job_models (
    job   TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    model TEXT NOT NULL REFERENCES models (id) ON DELETE CASCADE,
    step  INTEGER NOT NULL,
    PRIMARY KEY (job, model)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_models_of_model ON job_models (model);
