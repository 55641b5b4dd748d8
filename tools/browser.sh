#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Prints the path of a Chromium for the tests of the live page; installs Debian's where there is
# none: `tools/browser.sh [FOLDER]`. With root into the system, else into FOLDER/browser (default
# .ros). `tools/browser.sh --find [FOLDER]` only searches. Nothing printed: there is none, and
# the browser tests are skipped; the status is 0, or 1 where REQUIRE_BROWSER is set.
set -euo pipefail
find_only=; [ "${1-}" != --find ] || { find_only=1; shift; }
home=$(realpath -m "${1:-$(dirname "${BASH_SOURCE[0]}")/../.ros}")/browser

find_browser() {
  for name in "${CHROMIUM-}" chromium chromium-browser google-chrome "$home/chromium" \
      "${HOME-}"/.cache/ms-playwright/chromium-*/chrome-linux*/chrome; do
    path=$(command -v "$name" 2> /dev/null) || continue
    # Ubuntu's chromium-browser may be a stub that asks for a snap
    if "$path" --version > /dev/null 2>&1; then echo "$path"; return; fi
  done
  return 1
}

apt() { apt-get -o Acquire::Retries=1 -o Acquire::http::Timeout=20 "$@"; }

install_system_wide() {
  apt update && apt install -y --no-install-recommends chromium
}

unpack_locally() {
  mkdir -p "$home"/{lists,cache,debs,root}
  local ours=(-o "Dir::State::Lists=$home/lists" -o "Dir::Cache=$home/cache")
  apt "${ours[@]}" update
  local names
  names=$(apt "${ours[@]}" -s install --no-install-recommends chromium | awk '/^Inst/ {print $2}')
  # word splitting is intended: one package per word
  # shellcheck disable=SC2086
  (cd "$home/debs" && apt "${ours[@]}" download $names)
  for deb in "$home"/debs/*.deb; do dpkg -x "$deb" "$home/root"; done
  rm -r "$home/debs" "$home/cache" "$home/lists"
  local lib="$home/root/usr/lib"
  printf '#!/bin/sh\nexport LD_LIBRARY_PATH="%s"\nexec "%s" "$@"\n' \
    "$(find "$lib" -name '*.so*' -printf '%h\n' | sort -u | paste -sd:)" \
    "$lib/chromium/chromium" > "$home/chromium"
  chmod +x "$home/chromium"
}

if find_browser; then exit; fi
if [ -z "$find_only" ]; then
  how=unpack_locally; [ "$(id -u)" != 0 ] || how=install_system_wide
  log=$(mktemp)
  echo '== Chromium for the browser tests (once, about 15 seconds)' >&2
  # not as a condition, in which bash ignores set -e
  (set -e; "$how") > "$log" 2>&1 & wait $! && found=$(find_browser) && {
    rm "$log"; echo "$found"; exit; }
  echo "no Chromium: the browser tests will be skipped; the installation ended with:" >&2
  tail -n 5 "$log" >&2
  echo "(name one in CHROMIUM, or: python3 -m playwright install --with-deps chromium)" >&2
  rm "$log"
fi
[ -z "${REQUIRE_BROWSER-}" ]
