// Pass blur_columns: the vertical low-rank filters (McGraw, eq. 2), summed over terms. Truncation overshoots, so the
// result is clamped to the range of the colours within the filter support. Writes premultiplied colour and coverage
// where there is any, and per tile of the picture which bins have content there.
// twin: src/bokeh/cpu/filter.rs

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> bank: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> rows: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> filtered: array<u32>;
@group(0) @binding(8) var<storage, read_write> blurred: array<vec2<u32>>;
@group(0) @binding(9) var<storage, read> todo: array<u32>;
@group(0) @binding(10) var<storage, read_write> shown: array<atomic<u32>>;

// Rows loaded at a time, of four terms; most filters need no more for a whole tile.
const CHUNK = 62u;

// Pixels of all rows, per term.
var<workgroup> values: array<vec2<u32>, 4 * CHUNK * RESULT_TILE_X>;
// Whether each of the first row tiles in the support of a tile has content (1), as in blur_rows. Most filters need no
// more tiles.
const CACHED = 24u;
var<workgroup> cached: array<u32, CACHED>;

fn list_offset(k: u32) -> u32 {
    return bins[k].active_at;
}

fn is_filtered(k: u32, pixel: vec2<u32>) -> bool {
    return filtered[HEAD + bins[k].filtered_at + tile_index(pixel, bins[k].size.x, rows_tile())] == 1u;
}

// Cached `is_filtered` for the column of row tiles within the support, from tile `first` on.
fn is_filtered_cached(k: u32, pixel: vec2<u32>, first: u32) -> bool {
    let tile = pixel.y / ROWS_TILE_Y - first;
    if tile < CACHED {
        return cached[tile] == 1u;
    }
    return is_filtered(k, pixel);
}

// Weighted sum over all terms of the pixels at `a` and `b`.
fn sum_pair(weights: vec4<f32>, a: u32, b: u32) -> vec4<f32> {
    let apart = CHUNK * RESULT_TILE_X;
    var sum = weights.x * (unpack_half4(values[a]) + unpack_half4(values[b]));
    if work.terms > 1u { sum += weights.y * (unpack_half4(values[a + apart]) + unpack_half4(values[b + apart])); }
    if work.terms > 2u { sum += weights.z * (unpack_half4(values[a + 2u * apart]) + unpack_half4(values[b + 2u * apart])); }
    if work.terms > 3u { sum += weights.w * (unpack_half4(values[a + 3u * apart]) + unpack_half4(values[b + 3u * apart])); }
    return sum;
}

// Stores the result of a pixel, and clamps it after the last group of terms.
fn store_result(k: u32, pixel: vec2<u32>, corner: Corner, own: vec4<f32>) {
    var sum = own;
    let at = bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x;
    if work.group > 0u {
        sum += unpack_half4(blurred[at]);
    }
    if work.last == 1u && frame.compositing != 2u {
        let low = mix(interpolate_edge(corner, 0u), interpolate_edge(corner, 2u), corner.along).yzw;
        let high = mix(interpolate_edge(corner, 1u), interpolate_edge(corner, 3u), corner.along).xyz;
        // A whole bin covers everything, to which halves do not quite sum.
        sum.a = select(clamp(sum.a, 0.0, 1.0), 1.0, bins[k].whole == 1u);
        sum = vec4(min(max(sum.rgb, low * sum.a), high * sum.a), sum.a);
    }
    blurred[at] = pack_half4(sum);
}

fn filter_columns(k: u32, number: u32, local: vec2<u32>, thread: u32) {
    let size = bins[k].size;
    let across = result_tiles_across(k);
    let tile = vec2(number % across, number / across);
    if work.last == 1u {
        mark_shown_tiles(k, tile, thread);
    }
    let corner_pixel = tile * result_tile();
    let pixel = corner_pixel + local;
    let half_width = i32(bins[k].half_width);
    let first = i32(corner_pixel.y) - half_width;
    let length = i32(RESULT_TILE_Y) + 2 * half_width;
    let threads = RESULT_TILE_X * RESULT_TILE_Y;
    let first_tile = u32(max(first, 0)) / ROWS_TILE_Y;
    for (var n = thread; n < CACHED && (first_tile + n) * ROWS_TILE_Y < u32(min(first + length, i32(size.y))); n += threads) {
        cached[n] = select(0u, 1u, is_filtered(k, vec2(corner_pixel.x, (first_tile + n) * ROWS_TILE_Y)));
    }
    workgroupBarrier();
    let inside = all(pixel < size);
    var corner: Corner;
    var taps: Taps;
    if inside {
        corner = find_corner(k, pixel);
        taps = find_taps(k, pixel, corner);
    }
    let mirrored = can_mirror_taps(length, CHUNK);
    var sum = vec4(0.0);
    for (var at = 0; at < length; at += i32(CHUNK)) {
        let held = RESULT_TILE_X * u32(min(i32(CHUNK), length - at));
        for (var n = thread; n < held; n += threads) {
            let x = min(corner_pixel.x + n % RESULT_TILE_X, size.x - 1u);
            let y = u32(clamp(first + at + i32(n / RESULT_TILE_X), 0, i32(size.y) - 1));
            let filled = is_filtered_cached(k, vec2(x, y), first_tile);
            for (var term = 0u; term < work.terms; term++) {
                var value = vec2(0u);
                if filled {
                    value = rows[bins[k].rows_at + term * frame.term_stride + y * size.x + x];
                }
                values[term * CHUNK * RESULT_TILE_X + n] = value;
            }
        }
        workgroupBarrier();
        // The pixel itself is in row `own` of this chunk; taps in other chunks are added in their iterations.
        let own = i32(pixel.y) - first - at;
        let line = own * i32(RESULT_TILE_X) + i32(local.x);
        let apart = i32(RESULT_TILE_X);
        if mirrored {
            sum += 0.5 * sum_pair(interpolate_tap(taps, corner.along, 0), u32(line), u32(line));
            for (var j = 1; j <= taps.half_width; j++) {
                sum += sum_pair(interpolate_tap(taps, corner.along, j), u32(line + j * apart), u32(line - j * apart));
            }
        } else {
            let last = select(-1 - own, min(taps.half_width, i32(CHUNK) - 1 - own), inside);
            for (var j = max(-taps.half_width, -own); j <= last; j++) {
                sum += 0.5 * sum_pair(interpolate_tap(taps, corner.along, j), u32(line + j * apart), u32(line + j * apart));
            }
        }
        workgroupBarrier();
    }
    if inside {
        store_result(k, pixel, corner, sum);
    }
}

@compute @workgroup_size(RESULT_TILE_X, RESULT_TILE_Y)
fn blur_columns(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
                @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    for (var n = workgroup.x;; n += workgroups.x) {
        let place = find_tile(n);
        if !place.some {
            break;
        }
        filter_columns(place.bin, place.tile, local.xy, thread);
    }
}
