// Pass coarse, of pull-push inpainting (Gortler et al., The Lumigraph, 1996): the levels of the pyramid that are too
// small for several workgroups, pulled up to the coarsest level and pushed back, known pixels only.
// twin: src/bokeh/cpu/levels.rs

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read_write> pyramid: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> known: array<f32>;

fn load_known(level: Level, pixel: vec2<u32>) -> Known {
    let index = pixel_index(level, pixel);
    return Known(pyramid[index], known[index]);
}

fn pull(fine: Level, coarse: Level, pixel: vec2<u32>) {
    var sum = Known(vec4(0.0), 0.0);
    for (var sub = 0u; sub < 4u; sub++) {
        let below = 2u * pixel + vec2(sub % 2u, sub / 2u);
        if all(below < fine.size) {
            sum = plus(sum, load_known(fine, below));
        }
    }
    let index = pixel_index(coarse, pixel);
    pyramid[index] = pull_sum(sum).value;
    known[index] = pull_sum(sum).known;
}

fn push(fine: Level, coarse: Level, pixel: vec2<u32>) {
    let own = load_known(fine, pixel);
    if own.known >= 1.0 {
        return;
    }
    let b = neighbour_pixels(pixel, coarse.size);
    let near = plus(times(load_known(coarse, b.xz), 0.75), times(load_known(coarse, b.yz), 0.25));
    let far = plus(times(load_known(coarse, b.xw), 0.75), times(load_known(coarse, b.yw), 0.25));
    let index = pixel_index(fine, pixel);
    let all = push_into(own, plus(times(near, 0.75), times(far, 0.25)));
    pyramid[index] = all.value;
    known[index] = all.known;
}

@compute @workgroup_size(TILE, TILE)
fn coarse(@builtin(local_invocation_index) thread: u32) {
    let first = pyramid_level(TILED_LEVELS);
    var levels = 0u;
    for (var fine = first; !is_coarsest(fine.size); fine = coarser_level(fine)) {
        let above = coarser_level(fine);
        for (var k = thread; k < above.size.x * above.size.y; k += TILE * TILE) {
            pull(fine, above, vec2(k % above.size.x, k / above.size.x));
        }
        storageBarrier();
        levels++;
    }
    for (var k = levels; k > 0u; k--) {
        let fine = pyramid_level(TILED_LEVELS + k - 1u);
        let above = coarser_level(fine);
        for (var k = thread; k < fine.size.x * fine.size.y; k += TILE * TILE) {
            push(fine, above, vec2(k % fine.size.x, k / fine.size.x));
        }
        storageBarrier();
    }
}
