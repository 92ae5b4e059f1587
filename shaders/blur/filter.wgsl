// Shared by the two filter passes: the taps at a pixel, linear between the edges of its segment.
// twin: src/bokeh/cpu/filter.rs (`Taps`)

// Position of a pixel among the edges: between two of them, and between two rows of cells.
struct Corner {
    above: u32,     // index of the left edge's first vector in the row of cells above
    below: u32,
    down: f32,      // 0 in the row above, 1 in the row below
    along: f32,     // 0 at the left edge, 1 at the right
}

struct Taps {
    left: i32,      // table index of tap 0 at the left edge
    right: i32,
    step: i32,      // table step from one tap to the next
    half_width: i32,
}

fn find_corner(k: u32, pixel: vec2<u32>) -> Corner {
    let down = max((f32(pixel.y) - (f32(CELL) - 1.0) / 2.0) / f32(CELL), 0.0);
    let above = min(u32(down), bins[k].cells.y - 1u);
    let below = min(above + 1u, bins[k].cells.y - 1u);
    let edge = bins[k].edges_at + pixel.x / SEGMENT;
    return Corner(2u * (edge + above * bins[k].edges), 2u * (edge + below * bins[k].edges), down - f32(above),
                  (f32(pixel.x % SEGMENT) + 0.5) / f32(SEGMENT));
}

// A vector of the left edge (0, 1) or right edge (2, 3) of a pixel's segment.
fn interpolate_edge(corner: Corner, index: u32) -> vec4<f32> {
    return mix(edges[corner.above + index], edges[corner.below + index], corner.down);
}

// Outermost tap of a node at full scale.
fn half_width_of_node(node: u32) -> i32 {
    let first = u32(OCTAVES_FROM_PX * frame.steps_per_px);
    var radius_px = f32(node) / frame.steps_per_px;
    if node > first {
        radius_px = bitcast<f32>(bitcast<u32>(OCTAVES_FROM_PX) + ((node - first) << OCTAVE_SHIFT));
    }
    return i32(ceil(max(radius_px * frame.extent - 0.5, 0.0)));
}

fn find_taps(k: u32, pixel: vec2<u32>, corner: Corner) -> Taps {
    var radii = vec2(interpolate_edge(corner, 0u).x, interpolate_edge(corner, 2u).x);
    var turned = k < frame.near_bins;
    if frame.compositing == 2u {
        // The only bin of a gather has the picture's scale; every pixel has a radius of its own.
        let coc_px = unpack_scene(scene[pixel.y * frame.size.x + pixel.x], frame.max_px).w;
        radii = vec2(abs(coc_px));
        turned = coc_px < 0.0;
    }
    let left = nearest_node(radii.x, frame.steps_per_px, frame.nodes);
    let right = nearest_node(radii.y, frame.steps_per_px, frame.nodes);
    // The filters for reduced scales come after those for full scale.
    let is_reduced = select(0u, frame.has_reduced, bins[k].scale > 1u);
    let nodes = vec2(left, right) + is_reduced * frame.nodes;
    let origin = (nodes * (2u * frame.half_width + 1u) + frame.half_width) * frame.groups + work.group;
    let step = select(i32(frame.groups), -i32(frame.groups), turned);
    // Clamped to the bin's outermost tap, however the device rounds.
    return Taps(i32(origin.x), i32(origin.y), step,
                min(half_width_of_node(max(left, right)) + i32(is_reduced * EXTRA_TAPS), i32(bins[k].half_width)));
}

// Tap `j` of four terms.
fn interpolate_tap(taps: Taps, along: f32, j: i32) -> vec4<f32> {
    return mix(bank[u32(taps.left + j * taps.step)], bank[u32(taps.right + j * taps.step)], along);
}

// Whether the equal taps at -j and j can share a multiplication: all `length` pixels of a line must be loaded.
fn can_mirror_taps(length: i32, held: u32) -> bool {
    return frame.symmetric == 1u && length <= i32(held);
}
