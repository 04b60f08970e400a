#!/bin/sh
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# Makes Debian packages, looks at what they say and hold, unpacks them beside each other, runs the program there, and
# builds a host against what is there; likewise the archive. Without dpkg's tools it says so.
# packages.sh CPACK CMAKE BUILD HOST.c
set -eu
cpack=$1 cmake=$2 build=$3 source=$4
here=$(dirname "$0")
command -v dpkg-shlibdeps >/dev/null || { echo "SKIP: no dpkg-shlibdeps"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
(cd "$build" && "$cpack" -G DEB -B "$folder") >"$folder/cpack.log" 2>&1 || { cat "$folder/cpack.log"; exit 1; }

version=$("$build/semrover" --version | sed 's/[^0-9]*\([0-9.]*\).*/\1/')
machine=$(dpkg --print-architecture)
file() { # of a package
    case "$1" in
    python3-*) echo "$folder/$1_${version}_all.deb" ;;
    *) echo "$folder/$1_${version}_$machine.deb" ;;
    esac
}
say() { dpkg-deb -f "$(file "$1")" "$2"; }
holds() {
    dpkg-deb -c "$(file "$1")" >"$folder/list"
    grep -E "\\./$2( -> .*)?\$" "$folder/list"
}
lacks() { if holds "$@"; then return 1; fi; }
expect() { echo "$1" | grep -E "$2" || { echo "no $2 in: $1"; exit 1; }; }

test "$(ls "$folder"/*.deb | wc -l)" = 4
libdir=usr/lib/[^/]+
for program in semrover semrover-eval semrover-scenes; do holds semrover "usr/bin/$program"; done
holds libsemrover0 "$libdir/libsemrover.so.0"
holds libsemrover0 "$libdir/libsemrover.so.$version"
holds libsemrover-dev "$libdir/libsemrover.so"
holds libsemrover-dev usr/include/semrover.h
holds libsemrover-dev "$libdir/pkgconfig/semrover.pc"
holds libsemrover-dev "$libdir/cmake/semrover/semroverConfig.cmake"
holds libsemrover-dev usr/share/semrover/host/vulkan_host.c
holds python3-semrover usr/lib/python3/dist-packages/semrover/__init__.py
for package in semrover libsemrover0 libsemrover-dev python3-semrover; do
    holds "$package" "usr/share/doc/$package/copyright"
    dpkg-deb -I "$(file "$package")" >"$folder/info"
    expect "$(say "$package" Version)" "^$version\$"
    expect "$(say "$package" Architecture)" "^($machine|all)\$"
    expect "$(say "$package" Maintainer)" authors
    expect "$(say "$package" Description)" street
done
lacks libsemrover-dev 'usr/include/[^.]*/.*' # no header of ours besides
lacks libsemrover-dev 'usr/bin/.+'
expect "$(say libsemrover0 Depends)" 'libc6 \(>=.*libvulkan1'
expect "$(say semrover Depends)" 'libpng16-16.*libvulkan1|libvulkan1.*libpng16-16'
expect "$(say libsemrover-dev Depends)" "libsemrover0 \\(= $version\\)"
expect "$(say python3-semrover Depends)" "libsemrover0 \\(= $version\\).*python3-numpy"
lacks python3-semrover '.*__pycache__.*'
if test -x "$build/semrover-view"; then
    holds semrover usr/bin/semrover-view
    expect "$(say semrover Depends)" "libsemrover0 \\(= $version\\)"
    expect "$(say semrover Depends)" libglfw3
fi

for package in "$folder"/*.deb; do dpkg-deb -x "$package" "$folder/root"; done
pc=$(dirname "$(find "$folder/root" -name semrover.pc)")
LD_LIBRARY_PATH=$pc/.. && export LD_LIBRARY_PATH
"$folder/root/usr/bin/semrover" --version
"$folder/root/usr/bin/semrover" bench --help >/dev/null # of another program beside it
test ! -x "$build/semrover-view" || "$folder/root/usr/bin/semrover" view --help >/dev/null
PYTHONPATH=$folder/root/usr/lib/python3/dist-packages /usr/bin/python3 -B -c 'import semrover; semrover.Context().close()'
host_against() { # PREFIX
    mkdir -p "$folder/host"
    cp "$here/CMakeLists.txt" "$folder/host"
    cp "$source" "$folder/host/host.c"
    rm -rf "$folder/build"
    "$cmake" -S "$folder/host" -B "$folder/build" -DCMAKE_PREFIX_PATH="$1" >"$folder/configure.log"
    "$cmake" --build "$folder/build" >"$folder/build.log" || { cat "$folder/build.log"; exit 1; }
    "$folder/build/host" 2>&1 | grep usage
}
host_against "$folder/root/usr"
cc -std=c99 -o "$folder/by_hand" "$source" $(PKG_CONFIG_PATH=$pc pkg-config --cflags --libs semrover)
"$folder/by_hand" 2>&1 | grep usage

# the archive, which finds its own library
unset LD_LIBRARY_PATH
(cd "$build" && "$cpack" -G TGZ -B "$folder/tar") >"$folder/cpack.log" 2>&1 || { cat "$folder/cpack.log"; exit 1; }
tar -xzf "$folder/tar/semrover-$version-linux-$(uname -m).tar.gz" -C "$folder/tar"
unpacked=$folder/tar/semrover-$version-linux-$(uname -m)
"$unpacked/bin/semrover" --version
"$unpacked/bin/semrover" bench --help >/dev/null
test ! -x "$build/semrover-view" || "$unpacked/bin/semrover" view --help >/dev/null
"$unpacked/bin/semrover" inspect "$unpacked/share/semrover/model" >/dev/null
PYTHONPATH=$unpacked/share/semrover/python SEMROVER_LIBRARY=$unpacked/lib/libsemrover.so.0 \
    /usr/bin/python3 -B -c 'import semrover; semrover.Context().close()'
host_against "$unpacked"
