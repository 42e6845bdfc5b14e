#!/usr/bin/env bash
# Makes the archive that an operator installs: yoto-VERSION-ARCH-linux.tar.gz.
#
#   deploy/package.sh [--target TRIPLE] [--features FEATURES] [--out DIR]
#
# TRIPLE is this machine's unless given; aarch64-unknown-linux-gnu is built with Debian's cross compiler.
# DIR is target/package unless given.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() {
    echo "package.sh: $*" >&2
    exit 1
}

host="$(rustc -vV | sed -n 's/^host: //p')"
target="$host"
features=""
out=""
while [ $# -gt 0 ]; do
    case "$1" in
    --target | --features | --out) [ $# -ge 2 ] || fail "$1 needs a value" ;;&
    --target) target="$2" ;;
    --features) features="$2" ;;
    --out) out="$2" ;;
    *) fail "unknown option $1; --target, --features and --out are known" ;;
    esac
    shift 2
done
case "$target" in
*-linux-*) ;;
*) fail "$target is not a Linux target" ;;
esac
build="${CARGO_TARGET_DIR:-target}"
out="${out:-$build/package}"

for file in README.md LICENSE-MIT LICENSE-APACHE; do
    [ -f "$file" ] || fail "$file is missing"
done

strip="strip"
if [ "$target" != "$host" ]; then
    [ "$target" = aarch64-unknown-linux-gnu ] ||
        fail "$target can't be built on $host; aarch64-unknown-linux-gnu can"
    missing=""
    command -v aarch64-linux-gnu-gcc >/dev/null || missing="$missing gcc-aarch64-linux-gnu"
    command -v aarch64-linux-gnu-g++ >/dev/null || missing="$missing g++-aarch64-linux-gnu"
    [ -z "$missing" ] || fail "the cross compiler is missing: apt-get install$missing"
    # A toolchain without rustup may have the target anyway.
    [ -d "$(rustc --print sysroot)/lib/rustlib/$target" ] ||
        fail "Rust's standard library for $target is missing: rustup target add $target"
    export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
    export CC_aarch64_unknown_linux_gnu=aarch64-linux-gnu-gcc
    export CXX_aarch64_unknown_linux_gnu=aarch64-linux-gnu-g++
    export AR_aarch64_unknown_linux_gnu=aarch64-linux-gnu-ar
    strip=aarch64-linux-gnu-strip
fi
command -v "$strip" >/dev/null || fail "$strip is missing: apt-get install binutils"

# The file name says what it runs on, so that archives of several machines can lie beside each other.
version="$(cargo pkgid --locked -p yoto | sed 's/.*[#@]//')"
name="yoto-$version-${target%%-*}-linux"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
folder="$work/$name"
mkdir "$folder"

# Before the build, which takes much longer.
python3 deploy/licences.py --target "$target" --features "$features" --out "$folder/THIRD-PARTY-LICENSES.txt"
python3 deploy/sbom.py --target "$target" --features "$features" --out "$folder/yoto.cdx.json"

options=(--target-dir "$build")
program="$build/release/yoto"
if [ "$target" != "$host" ]; then
    options+=(--target "$target")
    program="$build/$target/release/yoto"
fi
[ -z "$features" ] || options+=(--features "$features")
cargo build --locked --profile release -p yoto --bin yoto "${options[@]}"

"$strip" -o "$folder/yoto" "$program"
chmod 755 "$folder/yoto"
install -m 644 README.md LICENSE-MIT LICENSE-APACHE "$folder/"
install -D -m 644 deploy/README.md "$folder/deploy/README.md"
install -D -m 644 -t "$folder/deploy/systemd" deploy/systemd/*.service

mkdir -p "$out"
# Sorted, and owned by root, so that the same files make the same archive.
tar --create --gzip --file "$out/$name.tar.gz" --directory "$work" \
    --sort=name --owner=0 --group=0 --numeric-owner "$name"
echo "$out/$name.tar.gz"
