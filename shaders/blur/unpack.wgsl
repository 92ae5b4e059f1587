// Pass unpack: 8-bit sRGB to linear light with highlights expanded; separates mixed pixels into two surfaces. Reads
// packed RGB bytes, and the depth map. Writes linear r, g, b and the CoC in pixels, and the
// CoC range of every tile; clears `shown`; lists the tiles of the foremost layer's bins; marks the silhouettes, one row
// of a grid cell per thread.
// twin: src/bokeh/cpu/unpack.rs, src/bokeh/cpu/marking.rs

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> color: array<u32>;
@group(0) @binding(4) var<storage, read> metres: array<f32>;
@group(0) @binding(5) var<storage, read_write> scene: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> ranges: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read_write> mixed: array<MixedPixel>;
@group(0) @binding(8) var<storage, read_write> shown: array<u32>;
@group(0) @binding(9) var<storage, read_write> next: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> marks: array<vec4<f32>>;

const PIXELS_PER_THREAD = 4u;          // pixels of a row per thread: three whole words, and the side of a cell

// Per pixel of the tile: its index among the mixed ones, plus one.
var<workgroup> places: array<u32, TILE * TILE>;
// Per thread: silhouette distances, in pixels.
var<workgroup> marked: array<vec4<f32>, TILE * TILE / PIXELS_PER_THREAD>;

fn decode_srgb(code: u32) -> f32 {
    let value = f32(code) * (1.0 / 255.0);
    return select(pow(value * (1.0 / 1.055) + 0.055 / 1.055, 2.4), value * (1.0 / 12.92), value <= 0.04045);
}

// Three bytes, from byte `at` on.
fn load_rgb_codes(at: u32) -> vec3<u32> {
    let shift = 8u * (at % 4u);
    // The rest is in the next word; the last pixel of the picture may end with the last word.
    let words = vec2(color[at / 4u], color[min(at / 4u + 1u, arrayLength(&color) - 1u)]);
    let bytes = (words.x >> shift) | select(words.y << (32u - shift), 0u, shift == 0u);
    return vec3(bytes, bytes >> 8u, bytes >> 16u) & vec3(255u);
}

// Finds the mixed pixels of a row of the tile.
fn find_mixed(first: vec2<u32>, row: u32) {
    let start = (first.y + row) * frame.size.x + first.x;
    let end = start + min(TILE, frame.size.x - first.x);
    for (var k = find_mixed_index(start); k < frame.mixed && mixed[k].at < end; k++) {
        places[row * TILE + mixed[k].at - start] = k + 1u;
    }
}

// Writes the nearer surface of a mixed pixel, and returns the farther one.
fn separate_surfaces(k: u32, light: vec3<f32>) -> vec2<u32> {
    let own = mixed[k];
    // Both colours get the highlight factor of the pixel, so that they composite to it again.
    var factor = 1.0;
    if frame.expansion > 0.0 {
        factor = (frame.expansion + luminance(light)) / frame.expansion;
    }
    let difference = factor * vec3(own.red, own.green, own.blue);
    // Depth may be that of another frame with other colours: light is clamped to 0.
    let near_light = max(light + (1.0 - own.alpha) * difference, vec3(0.0));
    let far_light = max(light - own.alpha * difference, vec3(0.0));
    let near = pack_scene(near_light, depth_to_coc(bitcast<f32>(own.near)), frame.max_px);
    let far = pack_scene(far_light, depth_to_coc(bitcast<f32>(own.far)), frame.max_px);
    mixed[k].near = near.x;
    mixed[k].far = near.y;
    return vec2(far.x, far.y | MIXED_FLAG);
}

@compute @workgroup_size(TILE / PIXELS_PER_THREAD, TILE)
fn unpack(@builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32,
          @builtin(workgroup_id) tile: vec3<u32>, @builtin(num_workgroups) tiles: vec3<u32>) {
    let first = tile.xy * TILE + vec2(PIXELS_PER_THREAD * local.x, local.y);
    if frame.mixed > 0u {
        for (var n = 0u; n < PIXELS_PER_THREAD; n++) {
            places[PIXELS_PER_THREAD * thread + n] = 0u;
        }
        workgroupBarrier();
        if local.x == 0u && first.y < frame.size.y {
            find_mixed(tile.xy * TILE, local.y);
        }
        workgroupBarrier();
    }
    // A smaller map has steps between its own pixels that are no silhouettes.
    let min_step_px = max(f32(frame.size.x) / f32(frame.depth_size.x), 1.0);
    var mark = NO_SILHOUETTE;
    var range = NOTHING;
    for (var n = 0u; n < PIXELS_PER_THREAD && first.x + n < frame.size.x && first.y < frame.size.y; n++) {
        let pixel = first.y * frame.size.x + first.x + n;
        let codes = load_rgb_codes(3u * pixel);
        var light = vec3(decode_srgb(codes.x), decode_srgb(codes.y), decode_srgb(codes.z));
        if frame.expansion > 0.0 {
            light *= frame.expansion / (frame.expansion - luminance(light));
        }
        var value = pack_scene(light, coc_at(first.x + n, first.y), frame.max_px);
        if frame.compositing == 0u {
            mark = max(mark, mark_pixel(first.x + n, first.y, min_step_px));
        }
        if frame.mixed > 0u {
            let place = places[PIXELS_PER_THREAD * thread + n];
            if place > 0u {
                value = separate_surfaces(place - 1u, light);
                let near_px = load_near_surface(place - 1u).w;
                let far_px = unpack_scene(value, frame.max_px).w;
                range = union_ranges(range, vec2(near_px));
                mark = max(mark, silhouette_between(near_px, far_px, min_step_px));
            }
        }
        scene[pixel] = value;
        // The value that other passes read, rounding included.
        range = union_ranges(range, vec2(unpack_scene(value, frame.max_px).w));
    }
    marked[thread] = mark;
    range = reduce_tile_range(thread, TILE * TILE / PIXELS_PER_THREAD, range);
    list_bin_tiles(tile.xy, range, thread);
    let cells = silhouette_grid_size(frame.size);
    let cell = first / SILHOUETTE_CELL;
    if frame.compositing == 0u && local.y % SILHOUETTE_CELL == 0u && all(cell < cells) {
        for (var row = 1u; row < SILHOUETTE_CELL; row++) {
            mark = max(mark, marked[thread + row * (TILE / PIXELS_PER_THREAD)]);
        }
        marks[cell.y * cells.x + cell.x] = mark;
    }
    if thread == 0u {
        ranges[tile.y * tiles.x + tile.x] = range;
        shown[tile.y * tiles.x + tile.x] = 0u;
    }
}
