#!/bin/sh
# Builds the C library and installs it with its headers and its pkg-config file: install.sh [PREFIX], by default ~/.local.
#
# DESTDIR is put before the prefix, for packagers. CARGO_PROFILE names another profile than `release`.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
prefix=${1:-$HOME/.local}
profile=${CARGO_PROFILE:-release}
to=${DESTDIR:-}$prefix

# Not `cargo build`, which also makes a library for Rust and then optimizes none of them across crates.
cargo rustc --manifest-path "$root/Cargo.toml" -p hero-ril --lib --crate-type cdylib,staticlib --profile "$profile"
built=${CARGO_TARGET_DIR:-$root/target}/$profile
# The profile `dev` builds into `debug`.
[ "$profile" != dev ] || built=${CARGO_TARGET_DIR:-$root/target}/debug
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$root/Cargo.toml" | head -n 1)

mkdir -p "$to/include/hero_ril" "$to/lib/pkgconfig"
install -m 644 "$here/include/hero_ril.h" "$here/include/hero_ril.hpp" "$root/ipc-types/layouts/hero_ipc.h" \
    "$to/include/hero_ril"
install -m 755 "$built/libhero_ril.so" "$to/lib"
install -m 644 "$built/libhero_ril.a" "$to/lib"
sed -e "s|@PREFIX@|$prefix|" -e "s|@VERSION@|$version|" "$here/hero_ril.pc.in" > "$to/lib/pkgconfig/hero_ril.pc"
echo "installed in $to: export PKG_CONFIG_PATH=$prefix/lib/pkgconfig"
