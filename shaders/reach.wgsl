// Pass reach: what the filters can reach from each edge of a segment, in the middle of each row of cells. Two vectors:
// radius in bin pixels and lowest colour; highest colour.

@group(0) @binding(0) var<uniform> bin_info: Bin;
@group(0) @binding(1) var<storage, read> grid: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> edges: array<vec4<f32>>;

const HUGE: f32 = 3.0e38;

struct Around {
    radius_px: f32,
    low: vec3<f32>,
    high: vec3<f32>,
}

fn nearness(distance: u32) -> f32 {
    let d = f32(distance) / bin_info.sigma_cells;
    return exp(-0.5 * d * d) + FAR_WEIGHT;
}

// The radius that blurs as much at the bin's scale as `coc_px` does at full size (plan.rs has the derivation).
fn bin_radius_px(coc_px: f32) -> f32 {
    var radius_px = coc_px;
    if bin_info.scale > 1u {
        let s = f32(bin_info.scale);
        radius_px = sqrt(max(coc_px * coc_px - (5.0 * s * s + 1.0) / 3.0, 0.0)) / s;
    }
    return min(radius_px, bin_info.max_radius_px);
}

fn around(cell: vec2<u32>) -> Around {
    let first = cell - min(cell, vec2(bin_info.reach_cells));
    let last = min(cell + bin_info.reach_cells, bin_info.cells - 1u);
    var sums = vec2(0.0);
    var low = vec3(HUGE);
    var high = vec3(-HUGE);
    for (var y = first.y; y <= last.y; y++) {
        let weight_y = nearness(max(y, cell.y) - min(y, cell.y));
        for (var x = first.x; x <= last.x; x++) {
            let index = 2u * (y * bin_info.cells.x + x);
            let a = grid[index];
            let b = grid[index + 1u];
            sums += a.xy * weight_y * nearness(max(x, cell.x) - min(x, cell.x));
            low = min(low, vec3(a.zw, b.x));
            high = max(high, b.yzw);
        }
    }
    let coc_px = select(0.0, sums.y / sums.x, sums.x > 0.0);
    // Where nothing is in reach there is nothing to keep in range.
    let some = low.r < HUGE;
    return Around(bin_radius_px(coc_px), select(vec3(0.0), low, some), select(vec3(0.0), high, some));
}

@compute @workgroup_size(8, 8)
fn reach(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= bin_info.edges || id.y >= bin_info.cells.y {
        return;
    }
    let right = id.x * SEGMENT / CELL;
    let a = around(vec2(right - min(right, 1u), id.y));
    let b = around(vec2(min(right, bin_info.cells.x - 1u), id.y));
    let index = 2u * (id.y * bin_info.edges + id.x);
    edges[index] = 0.5 * (vec4(a.radius_px, a.low) + vec4(b.radius_px, b.low));
    edges[index + 1u] = 0.5 * (vec4(a.high, 0.0) + vec4(b.high, 0.0));
}
