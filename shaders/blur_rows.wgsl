// Pass blur_rows: the horizontal low-rank filters of some bins, four terms at a time.
// Reads premultiplied colour and coverage; writes one such picture per term, and per tile whether anything is there.

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> bank: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> node_reach: array<u32>;
@group(0) @binding(5) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> grid: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read> source: array<vec2<u32>>;
@group(0) @binding(9) var<storage, read_write> rows: array<vec2<u32>>;
@group(0) @binding(10) var<storage, read_write> filtered: array<u32>;

// Columns that are held at a time; most filters need no more for a whole tile.
const CHUNK = 128u;

var<workgroup> values: array<vec2<u32>, CHUNK * ROWS_TILE_Y>;
var<workgroup> some: atomic<u32>;

fn extent_of(k: u32) -> vec2<u32> {
    return bins[k].size;
}

fn is_covered(k: u32, pixel: vec2<u32>) -> bool {
    let cell = pixel / CELL;
    return grid[2u * (bins[k].cells_at + cell.y * bins[k].cells.x + cell.x)].x > 0.0;
}

@compute @workgroup_size(ROWS_TILE_X, ROWS_TILE_Y)
fn blur_rows(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
             @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let place = place_of(workgroup, workgroups, rows_tile());
    let k = place.bin;
    let size = bins[k].size;
    let corner_pixel = place.tile * rows_tile();
    let pixel = corner_pixel + local.xy;
    let reach = i32(bins[k].reach);
    let first = i32(corner_pixel.x) - reach;
    let length = i32(ROWS_TILE_X) + 2 * reach;
    let threads = i32(ROWS_TILE_X * ROWS_TILE_Y);
    // Where no cell within reach is covered, nothing comes of it.
    for (var x = max(first, 0) / i32(CELL) + i32(thread); x * i32(CELL) < min(first + length, i32(size.x)); x += threads) {
        if place.some && is_covered(k, vec2(u32(x) * CELL, corner_pixel.y)) {
            atomicStore(&some, 1u);
        }
    }
    workgroupBarrier();
    let here = atomicLoad(&some) == 1u;
    let inside = here && all(pixel < size);
    if place.some && thread == 0u {
        filtered[bins[k].filtered_at + tile_of(pixel, size.x, rows_tile())] = u32(here);
    }
    var corner: Corner;
    var taps: Taps;
    if inside {
        corner = corner_of(k, pixel);
        taps = taps_at(k, pixel, corner);
    }
    var sum0 = vec4(0.0);
    var sum1 = vec4(0.0);
    var sum2 = vec4(0.0);
    var sum3 = vec4(0.0);
    for (var at = 0; at < length; at += i32(CHUNK)) {
        for (var n = i32(thread); here && n < i32(CHUNK * ROWS_TILE_Y); n += threads) {
            let x = u32(clamp(first + at + n % i32(CHUNK), 0, i32(size.x) - 1));
            let y = min(corner_pixel.y + u32(n / i32(CHUNK)), size.y - 1u);
            var value = vec2(0u);
            if at + n % i32(CHUNK) < length && is_covered(k, vec2(x, y)) {
                value = source[bins[k].pixels_at + y * size.x + x];
            }
            values[n] = value;
        }
        workgroupBarrier();
        // The pixel itself is value `own`; taps that lie in other chunks have their turn then.
        let own = i32(pixel.x) - first - at;
        let line = i32(local.y * CHUNK) + own;
        let last = select(-1 - own, min(taps.reach, i32(CHUNK) - 1 - own), inside);
        for (var j = max(-taps.reach, -own); j <= last; j++) {
            let weight = tap_at(taps, corner.along, j);
            let value = unpacked(values[line + j]);
            sum0 += weight.x * value;
            sum1 += weight.y * value;
            sum2 += weight.z * value;
            sum3 += weight.w * value;
        }
        workgroupBarrier();
    }
    if inside {
        let at = bins[k].rows_at + pixel.y * size.x + pixel.x;
        rows[at] = packed(sum0);
        if work.terms > 1u { rows[at + bins[k].rows_apart] = packed(sum1); }
        if work.terms > 2u { rows[at + 2u * bins[k].rows_apart] = packed(sum2); }
        if work.terms > 3u { rows[at + 3u * bins[k].rows_apart] = packed(sum3); }
    }
}
