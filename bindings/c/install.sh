#!/bin/sh
# Builds the C library and installs it with its headers, its pkg-config file and its CMake package: install.sh [PREFIX], by default
# ~/.local. The shared library has the version in its name: before 1.0 a program needs the minor version that it was linked with.
#
# DESTDIR is put before the prefix, for packagers. CARGO_PROFILE names another profile than `release`.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
prefix=${1:-$HOME/.local}
profile=${CARGO_PROFILE:-release}
to=${DESTDIR:-}$prefix

version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$root/Cargo.toml" | head -n 1)
major=${version%%.*}
minor=${version#*.}
minor=${minor%%.*}
soname=libhero_ril.so.$major
[ "$major" != 0 ] || soname=$soname.$minor
export HERO_RIL_SONAME="$soname"

# Not `cargo build`, which also makes a library for Rust and then optimizes none of them across crates.
cargo rustc --manifest-path "$root/Cargo.toml" -p hero-ril --lib --crate-type cdylib,staticlib --profile "$profile"
built=${CARGO_TARGET_DIR:-$root/target}/$profile
# The profile `dev` builds into `debug`.
[ "$profile" != dev ] || built=${CARGO_TARGET_DIR:-$root/target}/debug

# Fills in a template.
fill() {
    sed -e "s|@PREFIX@|$prefix|" -e "s|@VERSION@|$version|" -e "s|@SONAME@|$soname|" -e "s|@MAJOR@|$major|" -e "s|@MINOR@|$minor|" \
        -e "s|@LIBRARY@|libhero_ril.so.$version|" -e "s|@LINK_OPTIONS@||" "$1"
}

mkdir -p "$to/include/hero_ril" "$to/lib/pkgconfig" "$to/lib/cmake/hero_ril"
install -m 644 "$here/include/hero_ril.h" "$here/include/hero_ril.hpp" "$here/include/hero_ril_testing.h" "$root/ipc-types/layouts/hero_ipc.h" \
    "$to/include/hero_ril"
install -m 755 "$built/libhero_ril.so" "$to/lib/libhero_ril.so.$version"
ln -sf "libhero_ril.so.$version" "$to/lib/$soname"
ln -sf "$soname" "$to/lib/libhero_ril.so"
install -m 644 "$built/libhero_ril.a" "$to/lib"
fill "$here/hero_ril.pc.in" > "$to/lib/pkgconfig/hero_ril.pc"
for file in hero_ril-config.cmake hero_ril-config-version.cmake; do
    fill "$here/$file.in" > "$to/lib/cmake/hero_ril/$file"
done
echo "installed in $to: export PKG_CONFIG_PATH=$prefix/lib/pkgconfig"
