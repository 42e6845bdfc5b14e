-- Every row that a user can reach belongs to one tenant. Subjects, models, workers, jobs, request ids and pauses have its
-- column. The others reach it by their parent, so that the two can never disagree: captures by their subject (and with
-- them their files and violations), slots and checkpoints by their model, attempts, outputs, ranges and pins by their job,
-- kinds by their worker. Garbage and clocks are the service's.
--
-- Rows of earlier versions are the tenant's that a service without tenants has. The default is nobody's: a statement that
-- forgets the tenant makes a row that no tenant finds.
ALTER TABLE subjects ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
ALTER TABLE models ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
ALTER TABLE workers ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
UPDATE subjects SET tenant = 'default';
UPDATE models SET tenant = 'default';
UPDATE workers SET tenant = 'default';
UPDATE jobs SET tenant = 'default';

-- Each has the row's `ord` too: the pages of a list.
CREATE INDEX subjects_of_tenant ON subjects (tenant);
CREATE INDEX models_of_tenant ON models (tenant);
CREATE INDEX workers_of_tenant ON workers (tenant);
CREATE INDEX jobs_of_tenant ON jobs (tenant);

-- The search for the next job and the count of the jobs ahead of another stay within one tenant.
DROP INDEX jobs_in_turn;
CREATE INDEX jobs_in_turn ON jobs (state, tenant, kind, priority DESC, ord, owner, model, not_before);
DROP INDEX jobs_by_state;
CREATE INDEX jobs_by_state ON jobs (state, tenant, priority DESC, ord);

-- The view lists its columns when it is made.
DROP VIEW subject_catalogue;
CREATE VIEW subject_catalogue AS
SELECT s.*,
       CASE
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'READY')
               THEN 'READY'
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'INGESTING')
               THEN 'INGESTING'
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'UPLOADED')
               THEN 'UPLOADED'
           WHEN EXISTS (SELECT 1 FROM captures c WHERE c.subject = s.id AND c.state = 'REJECTED')
               THEN 'REJECTED'
           ELSE 'UPLOADING'
       END AS state,
       (SELECT group_concat(c.id, ',' ORDER BY c.ord) FROM captures c WHERE c.subject = s.id)
           AS captures
FROM subjects s;

-- Two tenants may use the same request id, and pause the same kind of jobs.
CREATE TABLE request_ids_2 (
    tenant      TEXT NOT NULL,
    method      TEXT NOT NULL,
    request_id  TEXT NOT NULL,
    body_sha256 TEXT NOT NULL,
    answer      TEXT NOT NULL,
    create_time REAL NOT NULL,
    PRIMARY KEY (tenant, method, request_id)
) STRICT, WITHOUT ROWID;
INSERT INTO request_ids_2 (tenant, method, request_id, body_sha256, answer, create_time)
SELECT 'default', method, request_id, body_sha256, answer, create_time FROM request_ids;
DROP TABLE request_ids;
ALTER TABLE request_ids_2 RENAME TO request_ids;

CREATE TABLE paused_kinds_2 (
    tenant TEXT NOT NULL,
    kind   TEXT NOT NULL,
    reason TEXT NOT NULL,
    since  REAL NOT NULL,
    PRIMARY KEY (tenant, kind)
) STRICT, WITHOUT ROWID;
INSERT INTO paused_kinds_2 (tenant, kind, reason, since) SELECT 'default', kind, reason, since FROM paused_kinds;
DROP TABLE paused_kinds;
ALTER TABLE paused_kinds_2 RENAME TO paused_kinds;
