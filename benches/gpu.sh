#!/usr/bin/env bash
# What the GPU executor does on this machine: first whether it agrees with the CPU's, then its time per pass.
#
# Prints one table: each pass's time by the device's own timestamps, the memory that it moves (as counted in
# docs/performance.md for this scene, "GPU: what moves"), and how near that is to what the memory can do.
#
#   benches/gpu.sh                                  builds, tests and measures
#   MEM_GBPS=1008 benches/gpu.sh                    also the share of the memory's bandwidth, in GB/s
#   BOKEHCAM=target/release/bokehcam benches/gpu.sh measures a binary as it is, without building or testing
#   SIZES=1280x720 FRAMES=5 ADAPTER=llvmpipe benches/gpu.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

sizes=${SIZES:-1920x1080,3840x2160}
frames=${FRAMES:-30}
if [[ -z "${BOKEHCAM:-}" ]]; then
    cargo build --release --locked
    cargo test --release --locked --test parity --test stereo_gpu -- --include-ignored
    # Depth from two eyes: each pass by the device's own timestamps, then whole pairs.
    for pair in 640x480x64 1280x720x128; do
        BOKEHCAM_PAIR=$pair cargo test --release --locked --test stereo_gpu -- --ignored --nocapture the_passes
    done
    cargo bench --locked --bench stereo -- times --gpu "${ADAPTER:-}" --size 640x480,1280x720 --disparities 64,128
    BOKEHCAM=${CARGO_TARGET_DIR:-target}/release/bokehcam
fi
options=(bench --scene portrait --backend gpu --passes --frames "$frames")
[[ -n "${ADAPTER:-}" ]] && options+=(--adapter "$ADAPTER")

failed=0
for size in ${sizes//,/ }; do
    # A size that the device cannot hold says so and the others go on.
    if ! lines=$("$BOKEHCAM" "${options[@]}" --sizes "$size"); then
        failed=1
        continue
    fi
    awk -v size="$size" -v gbps="${MEM_GBPS:-0}" '
        BEGIN {
            # Bytes moved a pixel of the picture, synthetic scene, default quality.
            split("unpack 15 bin 28 fill 35 reach 4 blur_rows 22 blur_columns 32 composite 9", pairs, " ")
            for (k = 1; k in pairs; k += 2) { order[(k + 1) / 2] = pairs[k]; moved[pairs[k]] = pairs[k + 1] }
            split(size, sides, "x")
            pixels = sides[1] * sides[2]
        }
        function row(name, ms, bytes) {
            floor_ms = gbps > 0 ? bytes / gbps / 1e6 : 0
            share = gbps > 0 && ms > 0 ? sprintf("%9.3f %5.0f %%", floor_ms, 100 * floor_ms / ms) : "        -       -"
            printf "%-14s %9.3f %9.1f %s\n", name, ms, bytes / 1e6, share
        }
        $1 == size { whole = $4; $1 = $2 = $3 = $4 = $5 = $6 = $7 = ""; sub(/^ +/, ""); executor = $0; next }
        executor != "" { for (k = 1; k < NF; k += 2) ms[$k] = $(k + 1) }
        END {
            if (executor == "") exit 1
            printf "\n%s, %s\n%-14s %9s %9s %9s %7s\n", size, executor, "pass", "ms", "MB moved", "floor ms", "share"
            for (k = 1; k in order; k++) if (order[k] in ms) {
                row(order[k], ms[order[k]], moved[order[k]] * pixels)
                sum += ms[order[k]]; all += moved[order[k]] * pixels; delete ms[order[k]]
            }
            for (name in ms) { row(name, ms[name], 0); sum += ms[name] }
            row("all passes", sum, all)
            printf "%-14s %9.3f   with upload, waiting and the way back\n", "whole frame", whole
        }' <<<"$lines" || { echo "$lines"; failed=1; }
done
exit "$failed"
