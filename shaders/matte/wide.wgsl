// Pass matte_wide, once per step: discards traced pixels of wide regions, since a hair never fills a square of three
// pixels. The outline of a wide region belongs to it, and counts as seen from the next step on.
// twin: `WideRegions` in src/depth/matting/trace.rs

@group(0) @binding(1) var<uniform> run: PassRun;
@group(0) @binding(2) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> places: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> entries: array<Entry>;

const NONE = 0xffffffffu;

// The entry of a traced pixel with a usable model, or `NONE`.
fn traced_entry(pixel: vec2<u32>, edges: u32) -> u32 {
    let place = atomicLoad(&places[pixel.y * frame.size.x + pixel.x]);
    let entry = place & ~ENTERED;
    if (place & ENTERED) == 0u || entry < edges || (atomicLoad(&entries[entry].flags) & LONE) != 0u {
        return NONE;
    }
    return entry;
}

@compute @workgroup_size(64)
fn matte_wide(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let edges = atomicLoad(&counts[EDGES]);
    let end = atomicLoad(&counts[NEXT]);
    let now = GROWN << (run.index % 2u);
    let before = GROWN << ((run.index + 1u) % 2u);
    for (var k = edges + id.x; k < end; k += 64u * groups.x) {
        let flags = atomicLoad(&entries[k].flags);
        if (flags & before) != 0u {
            atomicOr(&entries[k].flags, SEEN);
        }
        if (flags & LONE) != 0u || flags / STEP != run.index {
            continue;
        }
        let pixel = vec2(entries[k].at % frame.size.x, entries[k].at / frame.size.x);
        var is_full = true;
        for (var n = 0u; n < 9u && is_full; n++) {
            let other = pixel + vec2(n % 3u, n / 3u) - 1u;
            if all(other < frame.size) {
                let entry = traced_entry(other, edges);
                is_full = entry != NONE;
                if is_full {
                    is_full = (atomicLoad(&entries[entry].flags) & (SEEN | before)) != 0u;
                }
            }
        }
        for (var n = 0u; n < 25u && is_full; n++) {
            let other = pixel + vec2(n % 5u, n / 5u) - 2u;
            if all(other < frame.size) {
                let entry = traced_entry(other, edges);
                if entry != NONE {
                    atomicOr(&entries[entry].flags, WIDE | now);
                }
            }
        }
    }
}
