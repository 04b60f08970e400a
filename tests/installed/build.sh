#!/bin/sh
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# Installs the library into an empty folder, builds a host against it twice, and runs it.
# build.sh CMAKE BUILD HOST.c MODEL GRID
set -eu
cmake=$1 build=$2 source=$3 model=$4 grid=$5
here=$(dirname "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$cmake" --install "$build" --prefix "$folder/prefix" --component library >"$folder/install.log"
mkdir "$folder/host"
cp "$here/CMakeLists.txt" "$folder/host"
cp "$source" "$folder/host/host.c"
"$cmake" -S "$folder/host" -B "$folder/build" -DCMAKE_PREFIX_PATH="$folder/prefix" >"$folder/configure.log"
"$cmake" --build "$folder/build" >"$folder/build.log"
by_cmake=$("$folder/build/host" "$model" "$grid" "$folder/a.ppm")
pc=$(dirname "$(find "$folder/prefix" -name semrover.pc)")
flags=$(PKG_CONFIG_PATH=$pc pkg-config --cflags --libs semrover)
cc -std=c99 -o "$folder/by_hand" "$source" $flags -Wl,-rpath,"$pc/.."
by_hand=$("$folder/by_hand" "$model" "$grid" "$folder/b.ppm")
echo "$by_cmake"
test -n "$by_cmake" -a "$by_cmake" = "$by_hand"
cmp "$folder/a.ppm" "$folder/b.ppm"
