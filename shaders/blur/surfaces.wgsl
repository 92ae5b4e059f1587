// Shared by passes that composite the bins of a pixel, front to back. Such a pass binds `frame`, `bins`, `scene`,
// `shown` (bit mask of bins per tile) and `dilated` (silhouettes per cell of their grid), and defines `sample_bin`.
// twin: src/bokeh/cpu/layers.rs

// Bins composited front to back.
struct Stack {
    color: vec3<f32>,
    uncovered: f32,         // uncovered fraction
    hindmost: vec3<f32>,    // colour of the hindmost bin that counts, and how far it is known
    known: f32,
}

// Adds a bin behind all others: it covers part of the uncovered fraction.
fn add(stack: Stack, layer: vec4<f32>) -> Stack {
    let newly_covered = min(layer.a, stack.uncovered);
    let own = layer.rgb * (1.0 / max(layer.a, 1.0e-6));
    let counts = min(layer.a * (1.0 / HINDMOST_COVERAGE), 1.0);
    return Stack(stack.color + own * newly_covered, stack.uncovered - newly_covered,
                 mix(stack.hindmost, own, counts), mix(stack.known, 1.0, counts));
}

// The uncovered rest is hidden from the camera behind everything else: it gets the colour of the hindmost bin.
fn fill_uncovered(stack: Stack) -> vec3<f32> {
    return stack.color + stack.hindmost * (stack.uncovered / max(stack.known, 1.0e-6));
}

// Silhouette values at a pixel, bilinear between the cells of their grid.
fn silhouette_proximity(pixel: vec2<u32>) -> vec2<f32> {
    let cells = silhouette_grid_size(frame.size);
    let along = (vec2<f32>(pixel) + 0.5) * (1.0 / f32(SILHOUETTE_CELL)) - 0.5;
    let fraction = along - floor(along);
    let first = vec2<i32>(floor(along));
    let limit = vec2<i32>(cells - 1u);
    let a = vec2<u32>(clamp(first, vec2(0), limit));
    let b = vec2<u32>(clamp(first + 1, vec2(0), limit));
    return mix(mix(dilated[a.y * cells.x + a.x].xy, dilated[a.y * cells.x + b.x].xy, fraction.x),
               mix(dilated[b.y * cells.x + a.x].xy, dilated[b.y * cells.x + b.x].xy, fraction.x), fraction.y);
}

// Weight of a bin for the surface at a pixel, whose CoC changes by less than a pixel per pixel. In front, nearer
// content is blurred more and spreads farther.
fn own_surface_weight(k: u32, coc_px: f32) -> f32 {
    let scale = 1.0 / (abs(coc_px) + 1.0);
    let step = max((bins[k].front.x - coc_px) * scale, (coc_px - bins[k].behind.x) * scale - clamp(-coc_px, 0.0, 0.5));
    return clamp(2.0 - 2.0 * step, 0.0, 1.0);
}

// Away from all silhouettes a pixel shows only one surface, which is opaque: the bins that it spans fill the pixel
// together.
fn composite_layers(pixel: vec2<u32>) -> vec3<f32> {
    let coc_px = unpack_scene(scene[pixel.y * frame.size.x + pixel.x], frame.max_px).w;
    let shown_bins = shown[tile_index(pixel, frame.size.x, vec2(TILE))];
    let is_alone = countOneBits(shown_bins) == 1u;
    var own = Stack(vec3(0.0), 1.0, vec3(0.0), 0.0);
    for (var rest = shown_bins; rest != 0u; rest &= rest - 1u) {
        let k = firstTrailingBit(rest);
        own = add(own, sample_bin(k, pixel) * select(own_surface_weight(k, coc_px), 1.0, is_alone));
    }
    let covered = 1.0 - own.uncovered;
    let is_thin = covered <= MIN_OWN_COVERAGE;
    // Near silhouettes other surfaces are visible, faded out where the aperture sees no farther.
    let radius_px = max(-coc_px, 0.0) + MARGIN_PX;
    let visibility = clamp(silhouette_proximity(pixel) / (FADE_FRACTION * radius_px * radius_px), vec2(0.0), vec2(1.0));
    if visibility.x <= 0.0 && !is_thin {
        return own.color / covered;
    }
    // A pixel that is not in front shows the whole background behind near layers.
    var back = max(visibility.y, linear_step(bins[max(frame.near_bins, 1u) - 1u].behind, coc_px));
    if frame.near_bins == 0u || is_thin {
        back = 1.0;
    }
    return mix(own.color / max(covered, 1.0e-6), composite_all_surfaces(pixel, shown_bins, back),
               select(visibility.x, 1.0, is_thin));
}

// Composites the near bins over the others, with visibility `back_visibility`; otherwise the near ones fill the pixel.
fn composite_all_surfaces(pixel: vec2<u32>, shown_bins: u32, back_visibility: f32) -> vec3<f32> {
    var front = Stack(vec3(0.0), 1.0, vec3(0.0), 0.0);
    var back = front;
    for (var rest = shown_bins; rest != 0u; rest &= rest - 1u) {
        let k = firstTrailingBit(rest);
        let layer = sample_bin(k, pixel);
        if k < frame.near_bins {
            front = add(front, layer);
        } else {
            back = add(back, layer);
        }
    }
    if front.known <= 0.0 {
        return fill_uncovered(back);
    }
    // Without a background only the front is shown; an almost empty front has no colour to fill a pixel with.
    if back.known <= 1.0e-4 {
        return fill_uncovered(front);
    }
    let over = front.color + front.uncovered * fill_uncovered(back);
    if front.known <= 1.0e-3 {
        return over;
    }
    return mix(fill_uncovered(front), over, back_visibility);
}
