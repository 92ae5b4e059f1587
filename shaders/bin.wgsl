// Pass bin: a bin's share of each pixel, premultiplied and averaged down to the bin's scale, and the coarse grid over
// it. Reads the scene as the layer of the bins sees it; writes premultiplied r, g, b and coverage where there is any, and per
// cell of CELL x CELL bin pixels two vectors: coverage, coverage times |CoC|, lowest red and green; lowest blue, highest red,
// green and blue.

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> source: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> grid: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> ranges: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read> mixed: array<MixedPixel>;

const HUGE: f32 = 3.0e38;

// Of each pixel of the tile: its value, and coverage times |CoC|.
var<workgroup> values: array<vec4<f32>, TILE * TILE>;
var<workgroup> cocs: array<f32, TILE * TILE>;
// Whether any pixel that the tile is made of has a share.
var<workgroup> some: atomic<u32>;

fn extent_of(k: u32) -> vec2<u32> {
    return CELL * bins[k].cells;
}

fn tent(k: u32, scale: u32) -> f32 {
    let s = f32(scale);
    return select((1.0 - abs((f32(k) + 0.5) / s - 1.0)) / s, 1.0, scale == 1u);
}

// The cell at `first` within the tile.
fn measure(k: u32, cell: vec2<u32>, first: vec2<u32>) {
    var sums = vec2(0.0);
    var low = vec3(HUGE);
    var high = vec3(-HUGE);
    for (var j = 0u; j < CELL * CELL; j++) {
        let at = (first.y + j / CELL) * TILE + first.x + j % CELL;
        let value = values[at];
        sums += vec2(value.a, cocs[at]);
        if value.a > COVERAGE_FLOOR {
            let own = value.rgb * (1.0 / value.a);
            low = min(low, own);
            high = max(high, own);
        }
    }
    if all(cell < bins[k].cells) {
        let index = 2u * (bins[k].cells_at + cell.y * bins[k].cells.x + cell.x);
        grid[index] = vec4(sums, low.rg);
        grid[index + 1u] = vec4(low.b, high);
    }
}

// Looks at the tiles of the picture that a tile of the bin is made of, one a thread.
fn look(k: u32, tile: vec2<u32>, thread: u32) {
    let across = (frame.size + TILE - 1u) / TILE;
    let scale = bins[k].scale;
    let start = tile * TILE * scale;
    let first = (start - min(start, vec2(scale / 2u))) / TILE;
    let last = min((start + TILE * scale + scale / 2u - 1u) / TILE, across - 1u);
    let count = last - first + 1u;
    let at = first + vec2(thread % count.x, thread / count.x);
    if at.y <= last.y {
        let range = ranges[at.y * across.x + at.x];
        let meets = step_at(bins[k].front, range.y) > 0.0 && step_at(bins[k].behind, range.x) < 1.0;
        if meets || bins[k].whole == 1u {
            atomicStore(&some, 1u);
        }
    }
}

// A bin's share of a surface: premultiplied colour and coverage, and coverage times |CoC|.
fn taken(k: u32, surface: vec4<f32>, weight: f32) -> array<f32, 5> {
    let share = weight * select(share_at(bins[k].front, bins[k].behind, surface.w), 1.0, bins[k].whole == 1u);
    return array(share * surface.r, share * surface.g, share * surface.b, share, share * abs(surface.w));
}

fn plus(a: array<f32, 5>, b: array<f32, 5>) -> array<f32, 5> {
    return array(a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4]);
}

// A pixel of the bin, and coverage times |CoC|.
fn averaged(k: u32, pixel: vec2<u32>) -> array<f32, 5> {
    // A tent of twice the scale, so that reducing a picture keeps its centroid.
    let scale = bins[k].scale;
    let taps = select(2u * scale, 1u, scale == 1u);
    let before = select(scale / 2u, 0u, scale == 1u);
    var sum = array<f32, 5>();
    for (var j = 0u; j < taps; j++) {
        let y = clamp(i32(pixel.y * scale + j) - i32(before), 0, i32(frame.size.y) - 1);
        for (var i = 0u; i < taps; i++) {
            let x = clamp(i32(pixel.x * scale + i) - i32(before), 0, i32(frame.size.x) - 1);
            let at = u32(y) * frame.size.x + u32(x);
            let value = scene[at];
            let surface = scene_unpacked(value, frame.most_px);
            let weight = tent(i, scale) * tent(j, scale);
            if is_mixed(value) {
                let place = first_mixed(at);
                let near = near_surface(place);
                // Where the nearer surface lies in front of the layer, behind it is the farther one.
                let before = step_at(work.unhidden, near.w);
                sum = plus(sum, taken(k, surface, weight * (1.0 - (1.0 - mixed[place].behind) * before)));
                sum = plus(sum, taken(k, near, weight * mixed[place].share * before));
            } else {
                sum = plus(sum, taken(k, surface, weight));
            }
        }
    }
    return sum;
}

@compute @workgroup_size(TILE, TILE)
fn bin(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
       @builtin(local_invocation_id) local: vec3<u32>) {
    let place = place_of(workgroup, workgroups, vec2(TILE));
    let k = place.bin;
    let pixel = place.tile * TILE + local.xy;
    let at = local.y * TILE + local.x;
    if place.some {
        look(k, place.tile, at);
    }
    workgroupBarrier();
    var sum = vec4(0.0);
    var coc_sum = 0.0;
    if atomicLoad(&some) == 1u && all(pixel < bins[k].size) {
        let average = averaged(k, pixel);
        let value = packed(vec4(average[0], average[1], average[2], average[3]));
        source[bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x] = value;
        sum = unpacked(value);
        coc_sum = average[4];
    }
    values[at] = sum;
    cocs[at] = coc_sum;
    workgroupBarrier();
    let cells = TILE / CELL;
    if place.some && at < cells * cells {
        let cell = vec2(at % cells, at / cells);
        measure(k, place.tile * cells + cell, cell * CELL);
    }
}
