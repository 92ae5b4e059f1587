// Pass blur_rows: the horizontal low-rank filters of some bins (McGraw, eq. 2), four terms at a time. Reads
// premultiplied colour and coverage; writes one such picture per term, and lists the result tiles to compute.
// twin: src/bokeh/cpu/filter.rs

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> bank: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> grid: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read> source: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> rows: array<vec2<u32>>;
@group(0) @binding(9) var<storage, read> todo: array<u32>;
@group(0) @binding(10) var<storage, read_write> next: array<atomic<u32>>;

// Columns loaded at a time; most filters need no more for a whole tile.
const CHUNK = 128u;

var<workgroup> values: array<vec2<u32>, CHUNK * ROWS_TILE_Y>;
// Whether each of the first cells in the support of a tile has content (1). Most filters need no more cells. Not
// `bool`: with NVIDIA's driver 580, arrays of it in workgroup memory lose values.
const CACHED = 24u;
var<workgroup> cached: array<u32, CACHED>;

fn list_offset(k: u32) -> u32 {
    return bins[k].filtered_at;
}

// Lists the result tiles that depend on a row tile.
fn list_result_tiles(k: u32, corner: vec2<u32>, thread: u32) {
    let first = vec2(corner.x, corner.y - min(corner.y, bins[k].half_width)) / result_tile();
    let end = min(corner + rows_tile() - 1u + vec2(0u, bins[k].half_width), bins[k].size - 1u) / result_tile();
    let count = end - first + 1u;
    for (var n = thread; n < count.x * count.y; n += ROWS_TILE_X * ROWS_TILE_Y) {
        let tile = first + vec2(n % count.x, n / count.x);
        list_tile(k, bins[k].active_at, tile.y * result_tiles_across(k) + tile.x);
    }
}

// Cached `is_covered` for the row of cells within the support, from cell `first` on.
fn is_covered_cached(k: u32, pixel: vec2<u32>, first: u32) -> bool {
    let cell = pixel.x / CELL - first;
    if cell < CACHED {
        return cached[cell] == 1u;
    }
    return is_covered(k, pixel);
}

// Sums of a pixel, one for each of four terms.
struct Sums {
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec4<f32>,
    d: vec4<f32>,
}

fn plus(sums: Sums, weights: vec4<f32>, value: vec4<f32>) -> Sums {
    return Sums(sums.a + weights.x * value, sums.b + weights.y * value, sums.c + weights.z * value,
                sums.d + weights.w * value);
}

fn filter_rows(k: u32, tile: u32, local: vec2<u32>, thread: u32) {
    let size = bins[k].size;
    let across = row_tiles_across(k);
    let corner_pixel = vec2(tile % across, tile / across) * rows_tile();
    list_result_tiles(k, corner_pixel, thread);
    let pixel = corner_pixel + local;
    let half_width = i32(bins[k].half_width);
    let first = i32(corner_pixel.x) - half_width;
    let length = i32(ROWS_TILE_X) + 2 * half_width;
    let threads = i32(ROWS_TILE_X * ROWS_TILE_Y);
    let first_cell = u32(max(first, 0)) / CELL;
    for (var n = thread; n < CACHED && (first_cell + n) * CELL < u32(min(first + length, i32(size.x))); n += u32(threads)) {
        cached[n] = select(0u, 1u, is_covered(k, vec2((first_cell + n) * CELL, corner_pixel.y)));
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
    var sums = Sums(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    for (var at = 0; at < length; at += i32(CHUNK)) {
        for (var n = i32(thread); n < i32(CHUNK * ROWS_TILE_Y); n += threads) {
            let x = u32(clamp(first + at + n % i32(CHUNK), 0, i32(size.x) - 1));
            let y = min(corner_pixel.y + u32(n / i32(CHUNK)), size.y - 1u);
            var value = vec2(0u);
            if at + n % i32(CHUNK) < length && is_covered_cached(k, vec2(x, y), first_cell) {
                value = source[bins[k].pixels_at + y * size.x + x];
            }
            values[n] = value;
        }
        workgroupBarrier();
        // The pixel itself is value `own` of this chunk; taps in other chunks are added in their iterations.
        let own = i32(pixel.x) - first - at;
        let line = i32(local.y * CHUNK) + own;
        if mirrored {
            sums = plus(sums, interpolate_tap(taps, corner.along, 0), unpack_half4(values[line]));
            for (var j = 1; j <= taps.half_width; j++) {
                let both = unpack_half4(values[line + j]) + unpack_half4(values[line - j]);
                sums = plus(sums, interpolate_tap(taps, corner.along, j), both);
            }
        } else {
            let last = select(-1 - own, min(taps.half_width, i32(CHUNK) - 1 - own), inside);
            for (var j = max(-taps.half_width, -own); j <= last; j++) {
                sums = plus(sums, interpolate_tap(taps, corner.along, j), unpack_half4(values[line + j]));
            }
        }
        workgroupBarrier();
    }
    if inside {
        let at = bins[k].rows_at + pixel.y * size.x + pixel.x;
        rows[at] = pack_half4(sums.a);
        if work.terms > 1u { rows[at + frame.term_stride] = pack_half4(sums.b); }
        if work.terms > 2u { rows[at + 2u * frame.term_stride] = pack_half4(sums.c); }
        if work.terms > 3u { rows[at + 3u * frame.term_stride] = pack_half4(sums.d); }
    }
}

@compute @workgroup_size(ROWS_TILE_X, ROWS_TILE_Y)
fn blur_rows(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
             @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    for (var n = workgroup.x;; n += workgroups.x) {
        let place = find_tile(n);
        if !place.some {
            break;
        }
        filter_rows(place.bin, place.tile, local.xy, thread);
    }
}
