-- Names that people give checkpoints.
CREATE TABLE checkpoint_aliases (
    model TEXT NOT NULL,
    alias TEXT NOT NULL,
    step  INTEGER NOT NULL,
    PRIMARY KEY (model, alias),
    FOREIGN KEY (model, step) REFERENCES checkpoints (model, step) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
CREATE INDEX checkpoint_aliases_of_checkpoint ON checkpoint_aliases (model, step);
