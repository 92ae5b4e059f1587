// Pass unpack: 8-bit sRGB to linear light with highlights expanded; mixed pixels to two surfaces. Reads packed RGB bytes, and
// of a depth map the signed CoC or metres; writes linear r, g, b and the CoC in pixels, and the range of CoC of every tile,
// which shows no bins yet; lists the tiles of the bins of the foremost layer; marks the silhouettes, a cell of the grid each thread
// and row (silhouettes.rs has why).

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> color: array<u32>;
@group(0) @binding(4) var<storage, read> radii: array<u32>;      // two CoC a word, as in scene_packed; or metres
@group(0) @binding(5) var<storage, read_write> scene: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> ranges: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read_write> mixed: array<MixedPixel>;
@group(0) @binding(8) var<storage, read_write> shown: array<u32>;
@group(0) @binding(9) var<storage, read_write> next: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> marks: array<vec4<f32>>;

const ACROSS = 4u;          // pixels of a row that a thread does: three whole words, and a cell's

// Of each pixel of the tile: its place among the mixed ones, plus one.
var<workgroup> places: array<u32, TILE * TILE>;
// Of each thread: how far its silhouettes let show what lies behind, in pixels.
var<workgroup> marked: array<vec4<f32>, TILE * TILE / ACROSS>;

fn light_of(code: u32) -> f32 {
    let value = f32(code) * (1.0 / 255.0);
    return select(pow(value * (1.0 / 1.055) + 0.055 / 1.055, 2.4), value * (1.0 / 12.92), value <= 0.04045);
}

// Bytes of three, from byte `at` on.
fn codes_at(at: u32) -> vec3<u32> {
    let shift = 8u * (at % 4u);
    // What a word lacks is in the next one; the last pixel of the picture may end with the last word.
    let words = vec2(color[at / 4u], color[min(at / 4u + 1u, arrayLength(&color) - 1u)]);
    let bytes = (words.x >> shift) | select(words.y << (32u - shift), 0u, shift == 0u);
    return vec3(bytes, bytes >> 8u, bytes >> 16u) & vec3(255u);
}

// Notes which pixels of a row of the tile are mixed.
fn find_mixed(first: vec2<u32>, row: u32) {
    let start = (first.y + row) * frame.size.x + first.x;
    let end = start + min(TILE, frame.size.x - first.x);
    for (var k = first_mixed(start); k < frame.mixed && mixed[k].at < end; k++) {
        places[row * TILE + mixed[k].at - start] = k + 1u;
    }
}

// Writes the nearer surface of a mixed pixel, and returns the farther one.
fn take_apart(k: u32, light: vec3<f32>) -> vec2<u32> {
    let own = mixed[k];
    // Both colours are as bright as the pixel's highlights are made: their sum stays the pixel.
    var factor = 1.0;
    if frame.expansion > 0.0 {
        factor = (frame.expansion + luminance(light)) / frame.expansion;
    }
    let difference = factor * vec3(own.red, own.green, own.blue);
    // Depth may be that of another frame, with other colours: no light is below 0.
    let near_light = max(light + (1.0 - own.share) * difference, vec3(0.0));
    let far_light = max(light - own.share * difference, vec3(0.0));
    let near = scene_packed(near_light, coc_of_depth(bitcast<f32>(own.near)), frame.most_px);
    let far = scene_packed(far_light, coc_of_depth(bitcast<f32>(own.far)), frame.most_px);
    mixed[k].near = near.x;
    mixed[k].far = near.y;
    return vec2(far.x, far.y | MIXED);
}

@compute @workgroup_size(TILE / ACROSS, TILE)
fn unpack(@builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32,
          @builtin(workgroup_id) tile: vec3<u32>, @builtin(num_workgroups) tiles: vec3<u32>) {
    let first = tile.xy * TILE + vec2(ACROSS * local.x, local.y);
    if frame.mixed > 0u {
        for (var n = 0u; n < ACROSS; n++) {
            places[ACROSS * thread + n] = 0u;
        }
        workgroupBarrier();
        if local.x == 0u && first.y < frame.size.y {
            find_mixed(tile.xy * TILE, local.y);
        }
        workgroupBarrier();
    }
    // A smaller map has steps that are no silhouettes: those between its own pixels.
    let least_px = max(f32(frame.size.x) / f32(frame.depth_size.x), 1.0);
    var mark = NO_SILHOUETTE;
    var range = NOTHING;
    for (var n = 0u; n < ACROSS && first.x + n < frame.size.x && first.y < frame.size.y; n++) {
        let pixel = first.y * frame.size.x + first.x + n;
        let codes = codes_at(3u * pixel);
        var light = vec3(light_of(codes.x), light_of(codes.y), light_of(codes.z));
        if frame.expansion > 0.0 {
            light *= frame.expansion / (frame.expansion - luminance(light));
        }
        var value = scene_packed(light, coc_of(first.x + n, first.y), frame.most_px);
        if frame.compositing == 0u {
            mark = max(mark, mark_at(first.x + n, first.y, least_px));
        }
        if frame.mixed > 0u {
            let place = places[ACROSS * thread + n];
            if place > 0u {
                value = take_apart(place - 1u, light);
                let near_px = near_surface(place - 1u).w;
                let far_px = scene_unpacked(value, frame.most_px).w;
                range = union_of(range, vec2(near_px));
                mark = max(mark, silhouette(near_px, far_px, least_px));
            }
        }
        scene[pixel] = value;
        // What the others read, rounding included.
        range = union_of(range, vec2(scene_unpacked(value, frame.most_px).w));
    }
    marked[thread] = mark;
    range = range_of_tile(thread, TILE * TILE / ACROSS, range);
    put_binned(tile.xy, range, thread);
    let cells = cells_of(frame.size);
    let cell = first / GRAIN;
    if frame.compositing == 0u && local.y % GRAIN == 0u && all(cell < cells) {
        for (var row = 1u; row < GRAIN; row++) {
            mark = max(mark, marked[thread + row * (TILE / ACROSS)]);
        }
        marks[cell.y * cells.x + cell.x] = mark;
    }
    if thread == 0u {
        ranges[tile.y * tiles.x + tile.x] = range;
        shown[tile.y * tiles.x + tile.x] = 0u;
    }
}
