#!/usr/bin/env bash
# Makes the certificates that the tests of TLS use, valid for a century but for one that has expired: an authority, two
# of a service for localhost, and one of a client. The authority's key is thrown away: nothing else can be signed with it.
set -euo pipefail
cd "$(dirname "$0")"
scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT
ec=(-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes)
openssl req -x509 "${ec[@]}" -days 36500 -subj "/CN=yoto test authority" \
    -addext "basicConstraints=critical,CA:TRUE" -keyout "$scratch/authority.key" -out authority.pem
printf 'subjectAltName=DNS:localhost,IP:127.0.0.1\nbasicConstraints=CA:FALSE\n' >"$scratch/extensions"
sign() {
    local name="$1"
    shift
    openssl req "${ec[@]}" -subj "/CN=$name" -keyout "$scratch/key" -out "$scratch/request"
    openssl x509 -req -in "$scratch/request" -extfile "$scratch/extensions" "$@" \
        -CA authority.pem -CAkey "$scratch/authority.key" -out "$scratch/certificate"
    cat "$scratch/certificate" "$scratch/key" >"$name.pem"
}
sign first -days 36500
sign second -days 36500
sign client -days 36500
sign expired -days -1
# What `openssl req -x509` makes by itself: an authority in place of a server.
openssl req -x509 "${ec[@]}" -days 36500 -subj "/CN=localhost" -addext "subjectAltName=DNS:localhost" \
    -keyout "$scratch/key" -out "$scratch/certificate"
cat "$scratch/certificate" "$scratch/key" >self_signed.pem
