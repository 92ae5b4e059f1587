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

// What some pixels hold: their coverage and that times |CoC|, their lowest and highest colour.
struct Cell {
    sums: vec2<f32>,
    low: vec3<f32>,
    high: vec3<f32>,
}

var<workgroup> pixels: array<Pixel, TILE * TILE>;
// The rows of the tile's cells.
var<workgroup> rows: array<Cell, TILE * TILE / CELL>;

// How many threads a side share a pixel.
fn sharing(k: u32) -> u32 {
    return select(1u, 2u, bins[k].scale >= SHARED_FROM);
}

fn extent_of(k: u32) -> vec2<u32> {
    return CELL * bins[k].cells * sharing(k);
}

// Looks at the tiles of the picture that `side` pixels of the bin, each way, are made of, one a thread.
fn look(k: u32, first_pixel: vec2<u32>, side: u32, thread: u32) {
    let across = (frame.size + TILE - 1u) / TILE;
    let scale = bins[k].scale;
    let start = first_pixel * scale;
    let first = (start - min(start, vec2(scale / 2u))) / TILE;
    let last = min((start + side * scale + scale / 2u - 1u) / TILE, across - 1u);
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

fn write_cell(k: u32, cell: vec2<u32>, all: Cell) {
    let index = 2u * (bins[k].cells_at + cell.y * bins[k].cells.x + cell.x);
    grid[index] = vec4(all.sums, all.low.rg);
    grid[index + 1u] = vec4(all.low.b, all.high);
}

@compute @workgroup_size(TILE, TILE)
fn bin(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
       @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let place = place_of(workgroup, workgroups, vec2(TILE));
    if !place.some {
        return;
    }
    let k = place.bin;
    let step = sharing(k);
    let side = TILE / step;
    let corner = place.tile * side;
    begin(thread);
    look(k, corner, side, thread);
    let cells = side / CELL;
    let cell = corner / CELL + vec2(thread % cells, thread / cells);
    let writes = thread < cells * cells && all(cell < bins[k].cells);
    let nothing = Cell(vec2(0.0), vec3(HUGE), vec3(-HUGE));
    if workgroupUniformLoad(&some) == 0u {
        if writes {
            write_cell(k, cell, nothing);
        }
        return;
    }
    let averaging = corner + local.xy / step;
    var own = Pixel(vec4(0.0), 0.0);
    if all(averaging < bins[k].size) {
        own = averaged(k, averaging, local.xy % step, step);
    }
    if step > 1u {
        pixels[thread] = own;
        workgroupBarrier();
        let first = (thread / side * TILE + thread % side) * step % (TILE * TILE);
        own = plus(plus(pixels[first], pixels[first + 1u]), plus(pixels[first + TILE], pixels[first + TILE + 1u]));
        workgroupBarrier();
    }
    let pixel = corner + vec2(thread % side, thread / side);
    if thread < side * side {
        let value = packed(own.value);
        pixels[thread] = Pixel(unpacked(value), own.coc);
        if all(pixel < bins[k].size) {
            source[bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x] = value;
        }
    }
    workgroupBarrier();
    if thread < cells * cells * CELL {
        // A row of a cell. Neighbouring threads begin with other pixels, as memory has banks.
        let first = (thread / (cells * CELL) * CELL + thread % CELL) * side + thread / CELL % cells * CELL;
        var row = nothing;
        for (var j = 0u; j < CELL; j++) {
            let at = pixels[first + (j + thread) % CELL];
            row.sums += vec2(at.value.a, at.coc);
            if bins[k].has_lobes == 1u && at.value.a > COVERAGE_FLOOR {
                let own = at.value.rgb * (1.0 / at.value.a);
                row.low = min(row.low, own);
                row.high = max(row.high, own);
            }
        }
        rows[thread] = row;
    }
    workgroupBarrier();
    if writes {
        var all = nothing;
        for (var j = 0u; j < CELL; j++) {
            let row = rows[thread * CELL + j];
            all = Cell(all.sums + row.sums, min(all.low, row.low), max(all.high, row.high));
        }
        write_cell(k, cell, all);
    }
}
