#!/bin/sh
# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# Makes the wheel, unpacks it where nothing else of the sources is, and tests what is there.
set -eu
here=$(dirname "$(realpath "$0")")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$here/../../tools/python/build_wheel" "$folder"
/usr/bin/python3 -m zipfile -e "$folder"/*.whl "$folder/site"
cd "$folder"
PYTHONPATH=$folder/site /usr/bin/python3 "$here/test_package.py"
