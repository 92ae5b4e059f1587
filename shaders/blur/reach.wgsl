// Pass reach, a dilation of radii: mean radius and colour range within the filter support, at each segment edge, in the
// middle of each row of cells. Two vectors: radius in bin pixels and lowest colour; highest colour.
// twin: src/bokeh/cpu/reach.rs

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(2) var<storage, read> grid: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> edges: array<vec4<f32>>;

const HUGE: f32 = 3.0e38;

// The neighbourhoods of the cells on both sides of each edge.
var<workgroup> sides: array<Neighbourhood, TILE * SMALL_TILE>;

struct Neighbourhood {
    radius_px: f32,
    low: vec3<f32>,
    high: vec3<f32>,
}

fn work_size(k: u32) -> vec2<u32> {
    return vec2(2u * bins[k].edges, bins[k].cells.y);
}

fn cell_weight(k: u32, distance: u32) -> f32 {
    let d = f32(distance) / bins[k].sigma_cells;
    return exp(-0.5 * d * d) + MIN_CELL_WEIGHT;
}

// The radius that blurs as much at the bin's scale as `coc_px` does at full size (bank/reduced.rs has the derivation).
fn bin_radius_px(k: u32, coc_px: f32) -> f32 {
    var radius_px = coc_px;
    if bins[k].scale > 1u {
        let s = f32(bins[k].scale);
        radius_px = sqrt(max(coc_px * coc_px - (SPLINE_LEFT * s * s + 1.0) / 3.0, 0.0)) / s;
    }
    return min(radius_px, bins[k].max_radius_px);
}

fn combine_neighbourhood(k: u32, cell: vec2<u32>) -> Neighbourhood {
    let first = cell - min(cell, vec2(bins[k].radius_cells));
    let last = min(cell + bins[k].radius_cells, bins[k].cells - 1u);
    var sums = vec2(0.0);
    var low = vec3(HUGE);
    var high = vec3(-HUGE);
    for (var y = first.y; y <= last.y; y++) {
        let weight_y = cell_weight(k, max(y, cell.y) - min(y, cell.y));
        for (var x = first.x; x <= last.x; x++) {
            let index = 2u * (bins[k].cells_at + y * bins[k].cells.x + x);
            let a = grid[index];
            sums += a.xy * weight_y * cell_weight(k, max(x, cell.x) - min(x, cell.x));
            if bins[k].has_overshoot == 1u && a.x > 0.0 {
                let b = grid[index + 1u];
                low = min(low, vec3(a.zw, b.x));
                high = max(high, b.yzw);
            }
        }
    }
    let coc_px = select(0.0, sums.y / sums.x, sums.x > 0.0);
    if bins[k].has_overshoot == 0u {
        return Neighbourhood(bin_radius_px(k, coc_px), vec3(-UNBOUNDED_COLOR), vec3(UNBOUNDED_COLOR));
    }
    // Without content in the support there is no range to clamp to.
    let some = low.r < HUGE;
    return Neighbourhood(bin_radius_px(k, coc_px), select(vec3(0.0), low, some), select(vec3(0.0), high, some));
}

// Two threads per edge: one for the cell on its left, one for the cell on its right.
@compute @workgroup_size(TILE, SMALL_TILE)
fn reach(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
         @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let place = find_tile(workgroup, workgroups, vec2(TILE, SMALL_TILE));
    if !place.some {
        return;
    }
    let k = place.bin;
    let at = place.tile * vec2(TILE, SMALL_TILE) + local.xy;
    let inside = all(at < work_size(k));
    let edge = at.x / 2u;
    let right = edge * SEGMENT / CELL;
    if inside {
        let cell = select(right - min(right, 1u), min(right, bins[k].cells.x - 1u), at.x % 2u == 1u);
        sides[thread] = combine_neighbourhood(k, vec2(cell, at.y));
    }
    workgroupBarrier();
    if inside && at.x % 2u == 0u {
        let a = sides[thread];
        let b = sides[thread + 1u];
        let index = 2u * (bins[k].edges_at + at.y * bins[k].edges + edge);
        edges[index] = 0.5 * (vec4(a.radius_px, a.low) + vec4(b.radius_px, b.low));
        edges[index + 1u] = 0.5 * (vec4(a.high, 0.0) + vec4(b.high, 0.0));
    }
}
