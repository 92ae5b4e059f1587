// Pass fill, the inpainting of disocclusions: the scene as a layer sees it, with the layers in front of it replaced by
// the background. Reads the scene and pushes the pyramid down to it (pull-push); writes the scene of the layer in tiles
// with hidden pixels, and lists the tiles of its bins.
// twin: src/bokeh/cpu/fill.rs

@group(0) @binding(0) var<uniform> work: Work;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read> pyramid: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> known: array<f32>;
@group(0) @binding(4) var<storage, read> scene: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> ranges: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> inpainted: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> nearest_px: array<f32>;
@group(0) @binding(8) var<uniform> bins: array<Bin, MAX_BINS>;
@group(0) @binding(9) var<storage, read_write> next: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read> dilated: array<vec4<f32>>;
@group(0) @binding(11) var<storage, read> mixed: array<MixedPixel>;

// Side of the patch of a level that a tile depends on, its neighbours included, in pixels.
const PATCH = 6u;

// Patches of the coarser and the finer level, used alternately.
var<workgroup> patches: array<Known, 2u * PATCH * PATCH>;

// How likely the inpainted background is a different surface, by CoC: a surface that comes nearer, such as the ground,
// hides its own continuation, which looks like it.
fn other_surface_likelihood(own_px: f32, hidden: f32) -> f32 {
    let step = (own_px - hidden) / min(own_px, -1.0e-3);
    return clamp((step - OTHER_SURFACE_FROM) / (OTHER_SURFACE_TO - OTHER_SURFACE_FROM), 0.0, 1.0);
}

// First pixel of a tile's patch in a level; in level 0, of the tile.
fn patch_corner(tile: vec2<u32>, level: u32) -> vec2<u32> {
    var corner = tile * SMALL_TILE;
    for (var k = 0u; k < level; k++) {
        corner = corner / 2u - min(corner / 2u, vec2(1u));
    }
    return corner;
}

// Completes a pixel of a level from the patch of the coarser one.
fn complete_pixel(number: u32, own: Known, pixel: vec2<u32>, tile: vec2<u32>) -> Known {
    if own.known >= 1.0 {
        return own;
    }
    let b = neighbour_pixels(pixel, pyramid_level(number + 1u).size) - patch_corner(tile, number + 1u).xxyy;
    let at = (number + 1u) % 2u * PATCH * PATCH + vec4(b.xy, b.xy) + PATCH * vec4(b.zz, b.ww);
    let near = plus(times(patches[at.x], 0.75), times(patches[at.y], 0.25));
    let far = plus(times(patches[at.z], 0.75), times(patches[at.w], 0.25));
    return push_into(own, plus(times(near, 0.75), times(far, 0.25)));
}

// Replaces a pixel of the scene by the known background, if a silhouette uncovers it.
fn fill_pixel(value: vec2<u32>, background: Known, proximity: vec4<f32>) -> vec2<u32> {
    // Away from all silhouettes the background is not visible.
    if proximity.z <= 0.0 {
        return value;
    }
    let own = unpack_scene(value, frame.max_px);
    let visible_weight = linear_step(work.visible_weight, own.w);
    // A pixel that a silhouette only touches keeps its colour: it is visible, and inpainting would smear it. If
    // something near touches every pixel, nothing is known, and there is no background.
    if visible_weight == 1.0 || background.known <= 0.5 {
        return value;
    }
    let hidden = (1.0 - visible_weight) * other_surface_likelihood(own.w, background.value.w);
    // Where the background matters only for the blur of others, it must not mix with the surface in front, not even by
    // half.
    let focus_border_px = bins[min(frame.near_bins, frame.bins - 1u)].behind.x;
    let px = background.value.w;
    let may_mix_with_front = px <= focus_border_px * (1.0 + CROSS_FADE);
    let is_wanted = select(proximity.x > 0.0 || hidden >= 1.0, max(proximity.x, 0.0) > px * px, may_mix_with_front);
    if hidden == 0.0 || !is_wanted {
        return value;
    }
    let mixture = mix(own, vec4(background.value.rgb, max(background.value.w, work.nearest_px)), hidden);
    return pack_scene(mixture.rgb, mixture.w, frame.max_px) | vec2(0u, value.y & MIXED_FLAG);
}

// Four pixels per thread.
@compute @workgroup_size(SMALL_TILE, SMALL_TILE)
fn fill(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32,
        @builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let tile = workgroup.xy;
    let index = tile.y * workgroups.x + tile.x;
    if linear_step(work.visible_weight, ranges[index].x) == 1.0 {
        list_bin_tiles(tile, ranges[index], thread);
        return;
    }
    var coarsest = 0u;
    for (var size = finest_size(); coarsest < TILED_LEVELS && !is_coarsest(size); size = (size + 1u) / 2u) {
        coarsest++;
    }
    for (var number = coarsest; number > 0u; number--) {
        if thread < PATCH * PATCH {
            let level = pyramid_level(number);
            let pixel = min(patch_corner(tile, number) + vec2(thread % PATCH, thread / PATCH), level.size - 1u);
            let at = pixel_index(level, pixel);
            var own = Known(pyramid[at], known[at]);
            if number < coarsest {
                own = complete_pixel(number, own, pixel, tile);
            }
            patches[number % 2u * PATCH * PATCH + thread] = own;
        }
        workgroupBarrier();
    }
    let half = min(id.xy, finest_size() - 1u);
    var hidden = base_pixel(half);
    if coarsest > 0u {
        hidden = complete_pixel(0u, hidden, half, tile);
    }
    // Includes the original range: the nearer surface of a mixed pixel stays.
    var range = ranges[index];
    for (var sub = 0u; sub < 4u; sub++) {
        let at = 2u * id.xy + vec2(sub % 2u, sub / 2u);
        if all(at < frame.size) {
            let pixel = at.y * frame.size.x + at.x;
            let cell = at.y / SILHOUETTE_CELL * silhouette_grid_size(frame.size).x + at.x / SILHOUETTE_CELL;
            let value = fill_pixel(scene[pixel], hidden, dilated[cell]);
            inpainted[pixel] = value;
            range = union_ranges(range, vec2(unpack_scene(value, frame.max_px).w));
        }
    }
    list_bin_tiles(tile, reduce_tile_range(thread, SMALL_TILE * SMALL_TILE, range), thread);
}
