"""Renders the chart with several values and validates each object against the schemas of Kubernetes; refuses what it must.

    chart.py HELM [CRD …]

Kinds of Kubernetes are validated strictly, an unknown field is an error. KEDA's ScaledJob is validated against what the chart
uses of it (scaledjob.schema.json), its jobTargetRef as the spec of a Job. With files of KEDA's CRDs, they are used as well.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import jsonschema
import kubernetes_validate
import yaml

HERE = Path(__file__).resolve().parent
CHART = HERE.parent / "chart"
# The oldest that the chart allows and has a schema, and the newest.
KUBERNETES = ["1.28", "1.37"]
NEEDED = {"image": {"repository": "registry.example/yoto"}, "store": {"url": "s3://bucket/prefix"}}

GPU = {
    "workers": [
        {
            "name": "gpu",
            "kinds": ["train"],
            "needs": "gpu",
            "maxReplicas": 2,
            "resources": {"limits": {"nvidia.com/gpu": 1, "memory": "16Gi"}},
            "nodeSelector": {"pool": "gpu"},
            "tolerations": [{"key": "nvidia.com/gpu", "operator": "Exists", "effect": "NoSchedule"}],
        }
    ],
    "workerDefaults": {"gpuTag": "0.1.0-gpu"},
}
ACCEPTED = {
    "defaults": {},
    "everything": {
        "networkPolicy": {"enabled": True},
        "kueue": {"queue": "team"},
        "imagePullSecrets": [{"name": "registry"}],
        "keda": {"secret": "yoto-queue"},
        "store": {"endpoint": "http://store:8333", "allowHttp": True},
        "serviceAccount": {"annotations": {"eks.amazonaws.com/role-arn": "arn:aws:iam::1:role/yoto"}},
        "service": {"annotations": {"a/b": "c"}},
        "workerDefaults": {"keySecret": "yoto-worker"},
        "coordinators": {
            "extraArgs": ["--keep-newest=5"],
            "behindTls": True,
            "podAnnotations": {"prometheus.io/scrape": "true"},
            "nodeSelector": {"a": "b"},
            "tolerations": [{"operator": "Exists"}],
        },
    },
    "a pool with a GPU": GPU,
    "no KEDA": {"keda": {"enabled": False}, "store": {"secret": ""}},
    "no workers, no drain": {"workers": [], "coordinators": {"drainSeconds": 0}},
}
# Values, and a word of the refusal.
REFUSED = {
    "no image": ({"image": {"repository": ""}}, "repository"),
    "no store": ({"store": {"url": ""}}, "url"),
    "a store with a key in it": ({"store": {"url": "s3://key:secret@bucket/prefix"}}, "url"),
    "an unknown value": ({"coordinator": {"replicas": 3}}, "coordinator"),
    "an unknown kind": ({"workers": [{"name": "a", "kinds": ["paint"], "maxReplicas": 1}]}, "kinds"),
    "a kind in two pools": (
        {"workers": [{"name": n, "kinds": ["train"], "maxReplicas": 1} for n in ("a", "b")]},
        "belongs into one pool",
    ),
    "no coordinator": ({"coordinators": {"replicas": 0}}, "replicas"),
}


def merged(base, over):
    """`over` laid on `base`."""
    both = dict(base)
    for key, value in over.items():
        known = both.get(key)
        both[key] = merged(known, value) if isinstance(known, dict) and isinstance(value, dict) else value
    return both


def render(helm, values, release="prod"):
    """What `helm template` prints, or raises what it says."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        yaml.safe_dump(merged(NEEDED, values), file)
        file.flush()
        command = [helm, "template", release, str(CHART), "--values", file.name, "--kube-version", "1.33.0"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip())
    return [it for it in yaml.safe_load_all(done.stdout) if it]


def closed(schema):
    """A CRD's schema in which an unknown field is an error, as it is for `kubectl apply` with strict validation."""
    if isinstance(schema, list):
        return [closed(it) for it in schema]
    if not isinstance(schema, dict):
        return schema
    schema = {key: closed(value) for key, value in schema.items()}
    if isinstance(schema.get("properties"), dict) and "additionalProperties" not in schema:
        if not schema.get("x-kubernetes-preserve-unknown-fields"):
            schema["additionalProperties"] = False
    if schema.pop("x-kubernetes-int-or-string", False):
        schema["anyOf"] = [{"type": "integer"}, {"type": "string"}]
    return schema


def crds(files):
    """Schemas by kind."""
    found = {}
    for file in files:
        spec = yaml.safe_load(Path(file).read_text(encoding="utf-8"))["spec"]
        schema = closed(spec["versions"][0]["schema"]["openAPIV3Schema"])
        schema["properties"]["metadata"] = {"type": "object"}
        found[spec["names"]["kind"]] = schema
    return found


def validate(item, found):
    """Raises where an object is not what its kind allows."""
    kind = item["kind"]
    plain = [item]
    if kind in found:
        jsonschema.validate(item, found[kind])
    if kind == "ScaledJob":
        schema = json.loads((HERE / "scaledjob.schema.json").read_text(encoding="utf-8"))
        jsonschema.validate(item, schema)
        plain = [{"apiVersion": "batch/v1", "kind": "Job", "metadata": {"name": "x"}, "spec": item["spec"]["jobTargetRef"]}]
    elif kind == "TriggerAuthentication":
        for target in item["spec"]["secretTargetRef"]:
            assert set(target) == {"parameter", "name", "key"} and all(target.values()), target
        plain = []
    for one in plain:
        for version in KUBERNETES:
            kubernetes_validate.validate(one, version, strict=True)


def hardened(item):
    """Raises where a pod may more than it needs."""
    spec = item["spec"]
    template = spec["jobTargetRef"]["template"] if item["kind"] == "ScaledJob" else spec["template"]
    pod = template["spec"]
    assert pod["securityContext"]["runAsNonRoot"] is True and pod["securityContext"]["runAsUser"] > 0, "it may be root"
    assert pod["automountServiceAccountToken"] is False, "it has a token of the cluster"
    for container in pod["containers"]:
        security = container["securityContext"]
        assert security["readOnlyRootFilesystem"] is True, "its root file system can be written to"
        assert security["allowPrivilegeEscalation"] is False and security["capabilities"]["drop"] == ["ALL"]
        for variable in container.get("env", []):
            secret = "SECRET" in variable["name"] or "DATABASE" in variable["name"]
            assert not secret or "value" not in variable, f"{variable['name']} is written out"


def grace(item):
    """Raises where Kubernetes kills what has not had its time: the notice of a worker; the drain of a coordinator and its end."""
    spec = item["spec"]
    pod = (spec["jobTargetRef"]["template"] if item["kind"] == "ScaledJob" else spec["template"])["spec"]
    for argument in pod["containers"][0]["args"]:
        option, _, value = argument.partition("=")
        needed = {"--notice": 0, "--drain-seconds": 35}.get(option)
        if needed is not None:
            assert pod["terminationGracePeriodSeconds"] > int(value) + needed, f"its grace period is too short for {argument}"


def main():
    helm, files = sys.argv[1], sys.argv[2:]
    found, failures, objects = crds(files), [], 0
    for name, values in ACCEPTED.items():
        try:
            items = render(helm, values, "prod")
        except RuntimeError as error:
            failures.append(f"{name}: {error}")
            continue
        for item in items:
            objects += 1
            try:
                validate(item, found)
                if item["kind"] in ("Deployment", "ScaledJob"):
                    hardened(item)
                    grace(item)
                if item["kind"] == "ScaledJob":
                    assert item["spec"]["rollout"]["strategy"] == "gradual", "an upgrade ends its pods"
            except Exception as error:  # pylint: disable=broad-except
                text = str(error).splitlines()[0] if str(error) else repr(error)
                failures.append(f"{name}: {item['kind']} {item['metadata']['name']}: {text}")
    for name, (values, word) in REFUSED.items():
        try:
            render(helm, values)
            failures.append(f"{name}: accepted")
        except RuntimeError as error:
            if word not in str(error):
                failures.append(f"{name}: refused, but not for {word}: {error}")
    for failure in failures:
        print(failure, file=sys.stderr)
    if not failures:
        crd = f", ScaledJob against {len(files)} CRDs" if files else ""
        print(f"{objects} objects of {len(ACCEPTED)} sets of values, {len(REFUSED)} refusals{crd}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
