#!/bin/sh
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# Installs the library into an empty folder, builds the sample hosts that come with it there, runs them with validation,
# and looks at their pictures. Without EGL the one by OpenGL ES is left out, without Xvfb and GLFW the one with a window.
# hosts.sh CMAKE BUILD MODEL
set -eu
cmake=$1 build=$2 model=$3
here=$(dirname "$0")
folder=$(mktemp -d)
server=
trap 'test -z "$server" || kill "$server"; rm -rf "$folder"' EXIT
"$cmake" --install "$build" --prefix "$folder/prefix" --component library >"$folder/install.log"
"$cmake" -S "$folder/prefix/share/semrover/host" -B "$folder/build" -DCMAKE_PREFIX_PATH="$folder/prefix" \
    -DCMAKE_C_FLAGS=-Werror >"$folder/configure.log"
"$cmake" --build "$folder/build" >"$folder/build.log" || { cat "$folder/build.log"; exit 1; }

# core and synchronization; what the layer has to say goes to the standard output
export VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation
export VK_LAYER_ENABLES=VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT
silent() {
    "$@" >"$folder/said" || { cat "$folder/said"; exit 1; }
    cat "$folder/said"
    ! grep -E "VUID|Validation|SYNC-HAZARD" "$folder/said" >/dev/null
}

mkdir "$folder/frames"
silent "$folder/build/record_host" "$model" "$folder/frames" 2
/usr/bin/python3 "$here/see_cubes.py" record "$folder/frames/000000.ppm" "$folder/frames/000001.ppm"

if test -x "$folder/build/gles_host"; then
    mkdir "$folder/gles"
    silent "$folder/build/gles_host" "$model" "$folder/gles" 2
    /usr/bin/python3 "$here/see_cubes.py" record "$folder/gles/000000.ppm" "$folder/gles/000001.ppm"
else
    echo "no EGL: nothing by OpenGL ES"
fi

test -x "$folder/build/vulkan_host" && command -v Xvfb >/dev/null || { echo "no GLFW or no Xvfb: no window"; exit 0; }
Xvfb -displayfd 3 -screen 0 800x600x24 3>"$folder/display" 2>/dev/null &
server=$!
until test -s "$folder/display"; do sleep 0.1; done
DISPLAY=:$(cat "$folder/display")
export DISPLAY
silent "$folder/build/vulkan_host" "$model" 100 "$folder/window.ppm"
/usr/bin/python3 "$here/see_cubes.py" window "$folder/window.ppm"
