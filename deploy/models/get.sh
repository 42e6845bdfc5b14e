#!/usr/bin/env bash
# Fetches the pose model, BlazePose of MediaPipe (Apache-2.0), and its hand and face models from a package registry.
#
#   deploy/models/get.sh [DIR]     DIR is models/ unless given
#
# npm's package has the heavy landmark model, the most exact. Without npm (or with
# YOTO_MODELS_FROM=pip), PyPI's has the full one, which is smaller and less exact.
set -euo pipefail

dir="${1:-models}"
from="${YOTO_MODELS_FROM:-}"

if [ -z "$from" ]; then
    if command -v npm >/dev/null; then
        from=npm
    elif python3 -m pip --version >/dev/null 2>&1; then
        from=pip
    else
        echo "get.sh: neither npm nor Python's pip is installed; one of them is needed" >&2
        exit 1
    fi
fi

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/files"

case "$from" in
npm)
    (cd "$work" && npm pack --silent "@mediapipe/pose@0.5.1675469404" >/dev/null)
    tar -xzf "$work"/mediapipe-pose-*.tgz -C "$work"
    # The detector is the only file among the package's packed assets.
    cp "$work/package/pose_solution_packed_assets.data" "$work/files/pose_detection.tflite"
    cp "$work/package/pose_landmark_heavy.tflite" "$work/files/"
    (cd "$work" && rm -r package && npm pack --silent "@mediapipe/hands@0.4.1675469240" >/dev/null)
    tar -xzf "$work"/mediapipe-hands-*.tgz -C "$work"
    cp "$work/package/hand_landmark_full.tflite" "$work/files/"
    (cd "$work" && rm -r package && npm pack --silent "@mediapipe/face_mesh@0.4.1657299874" >/dev/null)
    tar -xzf "$work"/mediapipe-face_mesh-*.tgz -C "$work"
    # The second file of the packed assets.
    head -c 3737848 "$work/package/face_mesh_solution_packed_assets.data" | tail -c 1241896 >"$work/files/face_landmark.tflite"
    sums="a63c614bef30d35947f13be361820b1e4e3bec9cfeebf4d11216a18373108e85  pose_detection.tflite
59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe  pose_landmark_heavy.tflite
8c026882c9ec059ce0f8e75266bee5a9a23c341a40e0000df755374d3d1b9b68  hand_landmark_full.tflite
c603fa6149219a3e9487dc9abd7a0c24474c77263273d24868378cdf40aa26d1  face_landmark.tflite"
    ;;
pip)
    # Only the files of one wheel are wanted, whatever machine this is.
    python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: \
        --implementation cp --python-version 3.11 --abi cp311 \
        --platform manylinux2014_x86_64 --dest "$work" "mediapipe==0.10.14"
    python3 -m zipfile -e "$work"/mediapipe-*.whl "$work/wheel"
    modules="$work/wheel/mediapipe/modules"
    cp "$modules/pose_detection/pose_detection.tflite" "$work/files/"
    cp "$modules/pose_landmark/pose_landmark_full.tflite" "$work/files/"
    cp "$modules/hand_landmark/hand_landmark_full.tflite" "$work/files/"
    cp "$modules/face_landmark/face_landmark.tflite" "$work/files/"
    sums="9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c  pose_detection.tflite
e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f  pose_landmark_full.tflite
11c272b891e1a99ab034208e23937a8008388cf11ed2a9d776ed3d01d0ba00e3  hand_landmark_full.tflite
1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814  face_landmark.tflite"
    ;;
*)
    echo "get.sh: YOTO_MODELS_FROM is '$from'; npm and pip are known" >&2
    exit 1
    ;;
esac

(cd "$work/files" && printf '%s\n' "$sums" | sha256sum --check --quiet)
mkdir -p "$dir"
install -m 644 "$work"/files/*.tflite "$dir/"
echo "$dir: $(cd "$work/files" && echo *.tflite), by Google, Apache License 2.0" >&2
