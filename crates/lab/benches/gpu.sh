#!/usr/bin/env bash
# What the GPU executor does on this machine: first whether it agrees with the CPU's, then its time per pass.
#
# Prints one table a size: each pass's time by the device's own timestamps, their sum, and that of a whole frame.
#
#   crates/lab/benches/gpu.sh                                  builds, tests and measures
#   BOKEHCAM=target/release/bokehcam crates/lab/benches/gpu.sh measures a binary as it is, without building or testing
#   SIZES=1280x720 FRAMES=5 ADAPTER=llvmpipe crates/lab/benches/gpu.sh
set -euo pipefail
[[ "${1-}" != @(-h|--help) ]] || exec sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//p}' "$0"
cd "$(dirname "${BASH_SOURCE[0]}")/../../.."

sizes=${SIZES:-1920x1080,3840x2160}
frames=${FRAMES:-30}
if [[ -z "${BOKEHCAM:-}" ]]; then
    cargo build --release --locked
    cargo test --release --locked --features gpu --test blur -- --include-ignored parity:: shared_frame::
    cargo test --release --locked --features gpu --test pipeline -- --include-ignored yuyv
    cargo test --release --locked --features gpu --test depth -- --include-ignored gpu:: stereo_tidying::
    # Depth from two eyes: each pass by the device's own timestamps, then whole pairs.
    for pair in 640x480x64 1280x720x128; do
        BOKEHCAM_PAIR=$pair cargo test --release --locked --test depth -- --ignored --nocapture stereo_gpu::the_passes
    done
    # Refinement of depth and mattes, in the same way.
    for size in ${sizes//,/ }; do
        BOKEHCAM_SIZE=$size cargo test --release --locked --test depth -- --ignored --nocapture refine_gpu::the_passes matte_gpu::the_passes
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
    awk -v size="$size" '
        $1 == size { whole = $4; $1 = $2 = $3 = $4 = $5 = $6 = $7 = ""; sub(/^ +/, ""); executor = $0; next }
        executor != "" { for (k = 1; k < NF; k += 2) { names[++count] = $k; ms[count] = $(k + 1); sum += $(k + 1) } }
        END {
            if (executor == "") exit 1
            printf "\n%s, %s\n%-14s %9s\n", size, executor, "pass", "ms"
            for (k = 1; k <= count; k++) printf "%-14s %9.3f\n", names[k], ms[k]
            printf "%-14s %9.3f\n", "all passes", sum
            printf "%-14s %9.3f   with upload, waiting and the way back\n", "whole frame", whole
        }' <<<"$lines" || { echo "$lines"; failed=1; }
done
exit "$failed"
