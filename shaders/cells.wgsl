// Pass cells: the coarse grid over a bin. Per cell of CELL x CELL bin pixels, two vectors: coverage, coverage times
// |CoC|, lowest red and green; lowest blue, highest red, green, blue.

@group(0) @binding(0) var<uniform> bin_info: Bin;
@group(0) @binding(1) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> weighted_coc: array<f32>;
@group(0) @binding(3) var<storage, read_write> grid: array<vec4<f32>>;

const HUGE: f32 = 3.0e38;

@compute @workgroup_size(8, 8)
fn cells(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= bin_info.cells) {
        return;
    }
    var sums = vec2(0.0);
    var low = vec3(HUGE);
    var high = vec3(-HUGE);
    let first = id.xy * CELL;
    let last = min(first + CELL, bin_info.size);
    for (var y = first.y; y < last.y; y++) {
        for (var x = first.x; x < last.x; x++) {
            let value = source[y * bin_info.size.x + x];
            sums += vec2(value.a, weighted_coc[y * bin_info.size.x + x]);
            if value.a > COVERAGE_FLOOR {
                let own = value.rgb * (1.0 / value.a);
                low = min(low, own);
                high = max(high, own);
            }
        }
    }
    let index = 2u * (id.y * bin_info.cells.x + id.x);
    grid[index] = vec4(sums, low.rg);
    grid[index + 1u] = vec4(low.b, high);
}
