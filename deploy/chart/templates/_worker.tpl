{{/* Pod of a pool's worker: .root, .pool, .name, and .once for a worker that takes one job and ends. */}}
{{- define "yoto.workerPod" -}}
{{- $values := .root.Values }}
{{- $defaults := $values.workerDefaults }}
{{- $tag := $values.image.tag | default .root.Chart.AppVersion }}
{{- if eq (.pool.needs | default "") "gpu" }}{{ $tag = $defaults.gpuTag | default $tag }}{{ end }}
serviceAccountName: {{ include "yoto.name" .root }}
automountServiceAccountToken: false
enableServiceLinks: false
restartPolicy: {{ ternary "Never" "Always" .once }}
# A training saves within the notice; the rest is for the program's own end.
terminationGracePeriodSeconds: {{ add $defaults.noticeSeconds 15 }}
{{- with $values.imagePullSecrets }}
imagePullSecrets: {{ toYaml . | nindent 2 }}
{{- end }}
securityContext: {{ include "yoto.podSecurity" .root | nindent 2 }}
{{- with .pool.nodeSelector }}
nodeSelector: {{ toYaml . | nindent 2 }}
{{- end }}
{{- with .pool.tolerations }}
tolerations: {{ toYaml . | nindent 2 }}
{{- end }}
containers:
  - name: worker
    image: {{ $values.image.repository }}:{{ $tag }}
    imagePullPolicy: {{ $values.image.pullPolicy }}
    args:
      - worker
      - --log-format=json
      # All coordinators, not one address for them: a worker goes to another one by itself.
      - --service=http://{{ include "yoto.name" .root }}-coordinators:50051
      - --objects={{ $values.store.url }}
      - --name=$(POD_NAME)
      - --kinds={{ join "," .pool.kinds }}
      {{- with .pool.needs }}
      - --needs={{ . }}
      {{- end }}
      - --scratch=/var/lib/yoto/scratch
      - --notice={{ $defaults.noticeSeconds }}
      {{- if .once }}
      - --one-job
      - --max-idle={{ $defaults.maxIdleSeconds }}
      {{- end }}
    env:
      - name: POD_NAME
        valueFrom: {fieldRef: {fieldPath: metadata.name}}
      {{- with $defaults.keySecret }}
      - name: YOTO_KEY
        valueFrom: {secretKeyRef: {name: {{ . }}, key: key}}
      {{- end }}
      {{- include "yoto.storeEnvironment" .root | nindent 6 }}
    {{- with .pool.resources }}
    resources: {{ toYaml . | nindent 6 }}
    {{- end }}
    securityContext: {{ include "yoto.containerSecurity" .root | nindent 6 }}
    volumeMounts:
      - {name: data, mountPath: /var/lib/yoto}
      - {name: tmp, mountPath: /tmp}
volumes:
  - name: data
    emptyDir: {sizeLimit: {{ .pool.scratchSize | default "20Gi" }}}
  - name: tmp
    emptyDir: {}
{{- end }}
