// Pass bin: the weighted pixels of a bin, premultiplied and averaged down to its scale, and the coarse grid over it.
// Reads the scene as the layer of the bins sees it; writes premultiplied r, g, b and coverage where there is any, and
// per cell of CELL x CELL bin pixels two vectors: coverage, coverage times |CoC|, lowest red and green; lowest blue,
// highest red, green and blue.
// twin: src/bokeh/cpu/bin.rs

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> inpainted: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> ranges: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> source: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> grid: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read> mixed: array<MixedPixel>;
@group(0) @binding(9) var<storage, read> todo: array<u32>;
@group(0) @binding(10) var<storage, read_write> next: array<atomic<u32>>;

const HUGE: f32 = 3.0e38;

// Statistics of some pixels: coverage, coverage times |CoC|, lowest and highest colour.
struct Cell {
    sums: vec2<f32>,
    low: vec3<f32>,
    high: vec3<f32>,
}

var<workgroup> pixels: array<Pixel, TILE * TILE>;
// Row sums of the tile's cells.
var<workgroup> rows: array<Cell, TILE * TILE / CELL>;
// Whether any pixel has coverage: the tile was listed by its CoC range alone.
var<workgroup> some: atomic<u32>;

fn list_offset(k: u32) -> u32 {
    return bins[k].binned_at;
}

// Lists the row tiles whose filters reach a square of the bin at `corner`.
fn list_row_tiles(k: u32, corner: vec2<u32>, side: u32, thread: u32) {
    let first = vec2(corner.x - min(corner.x, bins[k].half_width), corner.y) / rows_tile();
    let end = min(corner + side - 1u + vec2(bins[k].half_width, 0u), bins[k].size - 1u) / rows_tile();
    let count = end - first + 1u;
    for (var n = thread; n < count.x * count.y; n += TILE * TILE) {
        let tile = first + vec2(n % count.x, n / count.x);
        list_tile(k, bins[k].filtered_at, tile.y * row_tiles_across(k) + tile.x);
    }
}

fn write_cell(k: u32, cell: vec2<u32>, all: Cell) {
    let index = 2u * (bins[k].cells_at + cell.y * bins[k].cells.x + cell.x);
    grid[index] = vec4(all.sums, all.low.rg);
    grid[index + 1u] = vec4(all.low.b, all.high);
}

fn bin_tile(k: u32, tile: u32, local: vec2<u32>, thread: u32) {
    let step = threads_per_axis(k);
    let side = TILE / step;
    let across = bin_tiles_across(k);
    let corner = vec2(tile % across, tile / across) * side;
    if thread == 0u {
        atomicStore(&some, 0u);
    }
    workgroupBarrier();
    let cells = side / CELL;
    let cell = corner / CELL + vec2(thread % cells, thread / cells);
    let nothing = Cell(vec2(0.0), vec3(HUGE), vec3(-HUGE));
    let averaging = corner + local / step;
    var own = Pixel(vec4(0.0), 0.0);
    if all(averaging < bins[k].size) {
        own = average_tent(k, averaging, local % step, step);
    }
    // Four threads share a pixel: adds up their partial averages.
    if step > 1u {
        pixels[thread] = own;
        workgroupBarrier();
        if thread < side * side {
            let first = (thread / side * TILE + thread % side) * step;
            own = plus(plus(pixels[first], pixels[first + 1u]), plus(pixels[first + TILE], pixels[first + TILE + 1u]));
        }
        workgroupBarrier();
    }
    let pixel = corner + vec2(thread % side, thread / side);
    if thread < side * side {
        let value = pack_half4(own.value);
        pixels[thread] = Pixel(unpack_half4(value), own.coc);
        if own.value.a > 0.0 {
            atomicStore(&some, 1u);
        }
        if all(pixel < bins[k].size) {
            source[bins[k].pixels_at + pixel.y * bins[k].size.x + pixel.x] = value;
        }
    }
    // The cells of an empty tile keep their cleared values.
    if workgroupUniformLoad(&some) == 0u {
        return;
    }
    list_row_tiles(k, corner, side, thread);
    if thread < cells * cells * CELL {
        // A row of a cell. Neighbouring threads start at different pixels to avoid bank conflicts.
        let first = (thread / (cells * CELL) * CELL + thread % CELL) * side + thread / CELL % cells * CELL;
        var row = nothing;
        for (var j = 0u; j < CELL; j++) {
            let at = pixels[first + (j + thread) % CELL];
            row.sums += vec2(at.value.a, at.coc);
            if bins[k].has_overshoot == 1u && at.value.a > MIN_COVERAGE {
                let own = at.value.rgb * (1.0 / at.value.a);
                row.low = min(row.low, own);
                row.high = max(row.high, own);
            }
        }
        rows[thread] = row;
    }
    workgroupBarrier();
    if thread < cells * cells && all(cell < bins[k].cells) {
        var all = nothing;
        for (var j = 0u; j < CELL; j++) {
            let row = rows[thread * CELL + j];
            all = Cell(all.sums + row.sums, min(all.low, row.low), max(all.high, row.high));
        }
        write_cell(k, cell, all);
    }
}

@compute @workgroup_size(TILE, TILE)
fn bin(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
       @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    for (var n = workgroup.x;; n += workgroups.x) {
        let place = find_tile(n);
        if !place.some {
            break;
        }
        bin_tile(place.bin, place.tile, local.xy, thread);
        workgroupBarrier();
    }
}
