{{/*
How many pods a pool needs: jobs that wait for it, and leases that its pods hold. KEDA subtracts the pods that run.

A job waits under the same conditions as in server/src/store/scripts/queue.rs. A model has one trainer at a time, so several
waiting trainings of one model count once, and none while one of them runs. Leases of workers that are not of this pool
(another machine's, or another engine's) do not count: KEDA does not count those workers either. A worker has the name of its pod,
which begins with the name of its ScaledJob.

deploy/checks/keda_query.py runs this text against a database.
*/}}
{{- define "yoto.queueQuery" -}}
{{- $kinds := list }}{{ range .pool.kinds }}{{ $kinds = append $kinds (printf "'%s'" .) }}{{ end -}}
SELECT
  (SELECT count(DISTINCT CASE WHEN q.kind = 'train' THEN q.model ELSE q.id END) FROM jobs q
   WHERE q.state = 'QUEUED' AND q.kind IN ({{ join ", " $kinds }})
     AND (q.not_before IS NULL OR q.not_before <= extract(epoch FROM clock_timestamp()))
     AND NOT EXISTS (SELECT 1 FROM drains)
     AND NOT EXISTS (SELECT 1 FROM paused_kinds p WHERE p.tenant = q.tenant AND p.kind = q.kind)
     AND NOT (q.kind = 'train' AND EXISTS (
       SELECT 1 FROM jobs r WHERE r.model = q.model AND r.kind = 'train' AND r.state = 'RUNNING')))
  + (SELECT count(*) FROM leases l JOIN workers w ON w.id = l.worker
     WHERE starts_with(w.display_name, '{{ .name }}-'))
{{- end }}
