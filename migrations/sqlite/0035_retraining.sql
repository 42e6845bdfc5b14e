-- Whether an erasure also trains the others of a model anew, and the model that it has made for that.
ALTER TABLE erasures ADD COLUMN retrain INTEGER NOT NULL DEFAULT 0;
ALTER TABLE erasure_models ADD COLUMN retrained TEXT;
