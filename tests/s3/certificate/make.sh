#!/usr/bin/env bash
# Makes the authority and the server's certificate that the tests of TLS use, valid for a century. The authority's key is
# thrown away: nothing else can be signed with it.
set -euo pipefail
cd "$(dirname "$0")"
scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT
ec=(-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes)
openssl req -x509 "${ec[@]}" -days 36500 -subj "/CN=yoto test authority" \
    -addext "basicConstraints=critical,CA:TRUE" -keyout "$scratch/authority.key" -out authority.pem
openssl req "${ec[@]}" -subj "/CN=localhost" -keyout "$scratch/server.key" -out "$scratch/server.csr"
printf 'subjectAltName=DNS:localhost,IP:127.0.0.1\nbasicConstraints=CA:FALSE\n' >"$scratch/extensions"
openssl x509 -req -in "$scratch/server.csr" -days 36500 -extfile "$scratch/extensions" \
    -CA authority.pem -CAkey "$scratch/authority.key" -out "$scratch/server.crt"
cat "$scratch/server.crt" "$scratch/server.key" >server.pem
