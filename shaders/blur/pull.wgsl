// Pass pull, of pull-push inpainting: the levels of the pyramid that a workgroup can compute from its tile of level 0.
// twin: src/bokeh/cpu/levels.rs (`Pull`)

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> nearest_px: array<f32>;
@group(0) @binding(4) var<storage, read_write> pyramid: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> known: array<f32>;
@group(0) @binding(6) var<storage, read> mixed: array<MixedPixel>;

// The tile's pixels of the last level; rows are TILE apart.
var<workgroup> tile: array<Known, TILE * TILE>;

fn store_known(level: Level, pixel: vec2<u32>, own: Known) {
    let index = pixel_index(level, pixel);
    pyramid[index] = own.value;
    known[index] = own.known;
}

@compute @workgroup_size(TILE, TILE)
fn pull(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>,
        @builtin(local_invocation_index) thread: u32) {
    // Each thread sums four pixels of level 0.
    var pixel = workgroup.xy * TILE + local.xy;
    var sum = Known(vec4(0.0), 0.0);
    for (var sub = 0u; sub < 4u; sub++) {
        let at = 2u * pixel + vec2(sub % 2u, sub / 2u);
        if all(at < finest_size()) {
            sum = plus(sum, base_pixel(at));
        }
    }
    var level = pyramid_level(1u);
    var more = !is_coarsest(finest_size());
    var side = TILE;
    for (var k = 1u; k <= TILED_LEVELS; k++) {
        let own = pull_sum(sum);
        if more && all(local.xy < vec2(side)) && all(pixel < level.size) {
            store_known(level, pixel, own);
        }
        more = more && !is_coarsest(level.size);
        level = coarser_level(level);
        workgroupBarrier();
        // The next level is computed from this one in shared memory.
        tile[thread] = own;
        workgroupBarrier();
        side /= 2u;
        pixel = workgroup.xy * side + local.xy;
        let first = (2u * local.y * TILE + 2u * local.x) % (TILE * TILE - TILE);
        sum = plus(plus(tile[first], tile[first + 1u]), plus(tile[first + TILE], tile[first + TILE + 1u]));
    }
}
