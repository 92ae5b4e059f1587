// Pass blur_columns: the vertical low-rank filters, terms summed; truncation leaves lobes, so the result is kept in
// the range of the colours in reach. Writes premultiplied colour and coverage where there is any, and per tile whether.

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> bank: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> node_reach: array<u32>;
@group(0) @binding(5) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> rows: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read> filtered: array<u32>;
@group(0) @binding(9) var<storage, read_write> blurred: array<vec2<u32>>;
@group(0) @binding(10) var<storage, read_write> active_tiles: array<u32>;

// Rows that are held at a time, of one term; most filters need no more for a whole tile.
const CHUNK = 64u;

var<workgroup> values: array<vec2<u32>, CHUNK * RESULT_TILE_X>;
var<workgroup> some: atomic<u32>;

fn extent_of(k: u32) -> vec2<u32> {
    return bins[k].size;
}

fn is_filtered(k: u32, pixel: vec2<u32>) -> bool {
    return filtered[bins[k].filtered_at + tile_of(pixel, bins[k].size.x, rows_tile())] == 1u;
}

@compute @workgroup_size(RESULT_TILE_X, RESULT_TILE_Y)
fn blur_columns(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
                @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let place = place_of(workgroup, workgroups, result_tile());
    let k = place.bin;
    let size = bins[k].size;
    let corner_pixel = place.tile * result_tile();
    let pixel = corner_pixel + local.xy;
    let reach = i32(bins[k].reach);
    let first = i32(corner_pixel.y) - reach;
    let length = i32(RESULT_TILE_Y) + 2 * reach;
    let across = i32(RESULT_TILE_X);
    let threads = i32(RESULT_TILE_X * RESULT_TILE_Y);
    let tile_rows = i32(ROWS_TILE_Y);
    for (var y = max(first, 0) / tile_rows + i32(thread); y * tile_rows < min(first + length, i32(size.y)); y += threads) {
        if place.some && is_filtered(k, vec2(corner_pixel.x, u32(y * tile_rows))) {
            atomicStore(&some, 1u);
        }
    }
    workgroupBarrier();
    let here = atomicLoad(&some) == 1u;
    let inside = here && all(pixel < size);
    if place.some && thread == 0u {
        active_tiles[bins[k].active_at + tile_of(pixel, size.x, result_tile())] = u32(here);
    }
    var corner: Corner;
    var taps: Taps;
    if inside {
        corner = corner_of(k, pixel);
        taps = taps_at(k, pixel, corner);
    }
    var sum = vec4(0.0);
    for (var term = 0u; term < work.terms; term++) {
        for (var at = 0; at < length; at += i32(CHUNK)) {
            for (var n = i32(thread); here && n < across * min(i32(CHUNK), length - at); n += threads) {
                let x = min(corner_pixel.x + u32(n % across), size.x - 1u);
                let y = u32(clamp(first + at + n / across, 0, i32(size.y) - 1));
                var value = vec2(0u);
                if is_filtered(k, vec2(x, y)) {
                    value = rows[bins[k].rows_at + term * bins[k].rows_apart + y * size.x + x];
                }
                values[n] = value;
            }
            workgroupBarrier();
            // The pixel itself is in row `own`; taps that lie in other chunks have their turn then.
            let own = i32(pixel.y) - first - at;
            let last = select(-1 - own, min(taps.reach, i32(CHUNK) - 1 - own), inside);
            for (var j = max(-taps.reach, -own); j <= last; j++) {
                sum += tap_at(taps, corner.along, j)[term] * unpacked(values[across * (own + j) + i32(local.x)]);
            }
            workgroupBarrier();
        }
    }
    if !inside {
        return;
    }
    let at = bins[k].pixels_at + pixel.y * size.x + pixel.x;
    if work.group > 0u {
        sum += unpacked(blurred[at]);
    }
    if work.last == 1u && frame.compositing != 2u {
        let low = mix(edge_at(corner, 0u), edge_at(corner, 2u), corner.along).yzw;
        let high = mix(edge_at(corner, 1u), edge_at(corner, 3u), corner.along).xyz;
        sum.a = clamp(sum.a, 0.0, 1.0);
        sum = vec4(min(max(sum.rgb, low * sum.a), high * sum.a), sum.a);
    }
    blurred[at] = packed(sum);
}
