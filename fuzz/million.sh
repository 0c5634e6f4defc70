#!/bin/sh
# A million executions of every parser of the replay room, on small intact files of each format as seeds.
# Usage: fuzz/million.sh [target …]; needs cargo-fuzz and a nightly toolchain. Ends with the first finding.
set -eu
cd "$(dirname "$0")/.."
seeds=$(mktemp -d)
trap 'rm -rf "$seeds"' EXIT
ENCKE_SEEDS="$seeds" cargo test --release -p replay --test torn -- --ignored seeds_for_fuzzing_are_written
for target in ${*:-pcap csv pcd nuscenes ply kitti mcap any}; do
    mkdir -p "fuzz/corpus/replay_$target"
    cargo +nightly fuzz run "replay_$target" "fuzz/corpus/replay_$target" "$seeds/replay_$target" -- \
        -runs=1000000 -max_len=12000 -timeout=30
done
