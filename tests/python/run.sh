#!/bin/sh
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# Makes the wheel, installs it into an empty environment, which sees the system's numpy, and tests what is there.
set -eu
here=$(dirname "$(realpath "$0")")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$here/../../tools/python/build_wheel" "$folder"
/usr/bin/python3 -m venv --system-site-packages "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-index --no-deps "$folder"/*.whl
cd "$folder"
unset PYTHONPATH
"$folder/venv/bin/python" -c 'import semrover, sys; assert semrover.__file__.startswith(sys.prefix), semrover.__file__'
"$folder/venv/bin/python" "$here/test_package.py"
"$folder/venv/bin/python" "$here/test_arrays.py"
