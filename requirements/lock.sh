#!/bin/sh
# Choose exact versions, with the hash of every file of each release, so that one list serves every Python and machine.
# Run by `make lock`, which leaves the choice to the newest versions that pyproject.toml and dev.in allow.
set -eu
cd "$(dirname "$0")/.."

tools=$(mktemp -d)
trap 'rm -rf "$tools"' EXIT
"${PYTHON:-python3}" -m venv "$tools"
"$tools/bin/pip" install --quiet --disable-pip-version-check 'pip-tools==7.6.2'

lock() { # OUTPUT SOURCE [OPTION]...
    output=requirements/$1
    shift
    # No option of pip's configuration, no index and no path of this machine goes into the list.
    CUSTOM_COMPILE_COMMAND='make lock' "$tools/bin/pip-compile" --quiet --no-config --rebuild \
        --generate-hashes --allow-unsafe --no-strip-extras --no-annotate \
        --no-emit-options --output-file "$output" "$@"
    sed -i 's/^# The following packages are considered.*/# builds the package/' "$output"
}

# runtime is part of completion, demo, gpio, web and workbench, and these are part of dev. setuptools, which builds the package, is in all
# of them: an installation fetches nothing that its list does not name.
rm -f requirements/*.txt
lock runtime.txt pyproject.toml --build-deps-for=editable
for extra in completion demo gpio web workbench; do
    lock "$extra.txt" pyproject.toml --build-deps-for=editable --extra="$extra" --constraint=requirements/runtime.txt
done
lock dev.txt requirements/dev.in
# No part of that row: what only its own command needs.
for tool in fuzz mutation reference; do
    lock "$tool.txt" "requirements/$tool.in"
done
