#!/bin/sh
# Make .venv, or keep it, and install a locked list and this checkout into it:  install.sh runtime|demo|workbench|dev|reference
# $PYTHON chooses the Python. Run by the Makefile, which calls this only when there is something to do.
set -eu
cd "$(dirname "$0")/.."
list=$1

fail() {
    printf '%s\n' "$@" >&2
    exit 1
}

find_python() {
    for candidate in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
    fail "No Python 3.11 or newer was found${PYTHON:+ under the name $PYTHON}." \
        'Debian 12, Ubuntu 24.04 and later have one:   apt-get install python3 python3-venv' \
        'One that is installed elsewhere is chosen by: make PYTHON=/path/to/python3'
}

# Debian and Ubuntu keep the half of venv that brings pip in a package of its own.
need_venv() {
    "$1" -c 'import ensurepip, venv' 2>/dev/null && return
    package=$("$1" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
    if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
        echo "Installing $package, without which $1 cannot make a virtual environment."
        export DEBIAN_FRONTEND=noninteractive
        apt-get install -y -qq "$package" || { apt-get update -qq && apt-get install -y -qq "$package"; }
    else
        fail "$1 cannot make a virtual environment: the package $package is missing. Type" \
            "    sudo apt-get install $package" \
            'and then the same make command again.'
    fi
}

if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
    python=$(find_python)
    need_venv "$python"
    echo "Making .venv with $python."
    "$python" -m venv --clear .venv
fi

echo "Installing requirements/$list.txt into .venv."
export PIP_DISABLE_PIP_VERSION_CHECK=1
# Wheels only: a source release would be built by tools that no list names.
.venv/bin/python -m pip install --quiet --only-binary :all: --require-hashes -r "requirements/$list.txt"
# compat: a plain path entry; setuptools' import hook would cost every start of the program 14 ms and 2 MiB.
.venv/bin/python -m pip install --quiet --no-deps --no-build-isolation --config-settings=editable_mode=compat --editable .
