// Pass matte_edges: creates the entries of edge pixels, row by row, with the labels of the map, and evaluates them
// against the colours of both surfaces around. Workgroups loop over the listed cells.
// twin: src/depth/matting/edges.rs and clusters/color_models.rs

@group(0) @binding(1) var<uniform> lights: array<vec4<f32>, 256>;
@group(0) @binding(2) var<storage, read> metres: array<u32>;
@group(0) @binding(3) var<storage, read> rgb: array<u32>;
@group(0) @binding(4) var<storage, read> background: array<u32>;
@group(0) @binding(5) var<storage, read> words: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> counts: array<u32>;
@group(0) @binding(7) var<storage, read> clusters: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(9) var<storage, read_write> places: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(11) var<storage, read_write> colors: array<Color>;

// Inverse depth of the pixel (`right` - 1, `down` - 1) away; the border is replicated.
fn neighbour_inverse(pixel: vec2<u32>, right: u32, down: u32) -> f32 {
    let at = min(max(pixel + vec2(right, down), vec2(1u)) - 1u, frame.size - 1u);
    return inverse_depth(metres[at.y * frame.size.x + at.x]);
}

// Labels of a pixel between two surfaces, from the map.
fn label_pixel(pixel: vec2<u32>, surfaces: vec2<f32>) -> u32 {
    let middle = 0.5 * (surfaces.x + surfaces.y);
    let is_near = neighbour_inverse(pixel, 1u, 1u) > middle;
    var alike = vec2(0u);           // corners including the pixel itself, and sides
    var borders = false;
    for (var k = 0u; k < 9u; k++) {
        let is_alike = (neighbour_inverse(pixel, k % 3u, k / 3u) > middle) == is_near;
        let is_there = all(pixel + vec2(k % 3u, k / 3u) - 1u < frame.size);
        alike[k % 2u] += select(0u, 1u, is_alike && is_there);
        borders = borders || (k % 2u == 1u && !is_alike);
    }
    // The pixel itself, and two neighbours at most.
    let is_thin = is_near && alike.x + alike.y <= 3u;
    var outline = 0u;
    for (var k = 0u; k < 5u; k++) {
        outline = select(outline, k + 1u, all(alike == vec2(OUTLINES[k].y + 1u, OUTLINES[k].x)));
    }
    return select(0u, NEAR, is_near) | select(0u, BORDERS, borders) | select(0u, THIN, is_thin) | OUTLINE * outline;
}

fn enter_edge_pixels(cell: vec2<u32>, thread: u32) {
    let pixel = cell * CELL + vec2(thread % CELL, thread / CELL);
    let word = min(pixel.y, frame.size.y - 1u) * words_across() + pixel.x / WORD;
    let bit = 1u << (pixel.x % WORD);
    let is_chosen = all(pixel < frame.size) && (words[word].x & bit) != 0u;
    let count = count_chosen(thread, is_chosen);
    var surfaces = vec2(0.0);
    var entry = 0u;
    var labels = 0u;
    if is_chosen {
        surfaces = vec2(neighbour_inverse(pixel, 1u, 1u));
        for (var k = 0u; k < 9u; k++) {
            let inverse = neighbour_inverse(pixel, k % 3u, k / 3u);
            surfaces = vec2(max(surfaces.x, inverse), min(surfaces.y, inverse));
        }
        // If this pixel is the farther one, its own surface is the far one, even beside a third one behind it.
        let own = neighbour_inverse(pixel, 1u, 1u);
        surfaces.y = select(surfaces.y, own, surfaces.x - own > frame.depth_step);
        labels = label_pixel(pixel, surfaces);
        entry = counts[TOTALS + word / BLOCK] + words[word].y + countOneBits(words[word].x & (bit - 1u));
    }
    create_entries(cell, 0u, count, thread, is_chosen, entry, pixel.y * frame.size.x + pixel.x, surfaces, labels);
}

@compute @workgroup_size(PIXELS)
fn matte_edges(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) thread: u32) {
    let end = select(counts[LISTED], 0u, counts[EDGES] == 0u);
    for (var k = group.x; k < end; k += groups.x) {
        let cell = cells[k].list[0];
        enter_edge_pixels(vec2(cell % cells_across(), cell / cells_across()), thread);
        workgroupBarrier();
    }
}
