// Shared by the passes that stack the bins of a pixel, front to back. Such a pass has `frame`, `bins`, `scene`, of each tile the
// bins that it shows, and what silhouettes reach each cell of their grid, `reached`; and samples bins.

// Bins stacked front to back.
struct Stack {
    color: vec3<f32>,
    open: f32,              // how much nothing has covered yet
    hindmost: vec3<f32>,    // the colour of the hindmost bin that counts, and how far that is known
    known: f32,
}

// A bin behind all there is covers what is still open.
fn add(stack: Stack, layer: vec4<f32>) -> Stack {
    let taken = min(layer.a, stack.open);
    let own = layer.rgb * (1.0 / max(layer.a, 1.0e-6));
    let counts = min(layer.a * (1.0 / HINDMOST_COVERAGE), 1.0);
    return Stack(stack.color + own * taken, stack.open - taken,
                 mix(stack.hindmost, own, counts), mix(stack.known, 1.0, counts));
}

// What is still open was hidden from the camera, and lies behind all else: it gets the colour of the hindmost.
fn closed(stack: Stack) -> vec3<f32> {
    return stack.color + stack.hindmost * (stack.open / max(stack.known, 1.0e-6));
}

// What silhouettes reach a pixel, linear between the cells of their grid.
fn reaching(pixel: vec2<u32>) -> vec2<f32> {
    let cells = cells_of(frame.size);
    let along = (vec2<f32>(pixel) + 0.5) * (1.0 / f32(GRAIN)) - 0.5;
    let share = along - floor(along);
    let first = vec2<i32>(floor(along));
    let limit = vec2<i32>(cells - 1u);
    let a = vec2<u32>(clamp(first, vec2(0), limit));
    let b = vec2<u32>(clamp(first + 1, vec2(0), limit));
    return mix(mix(reached[a.y * cells.x + a.x].xy, reached[a.y * cells.x + b.x].xy, share.x),
               mix(reached[b.y * cells.x + a.x].xy, reached[b.y * cells.x + b.x].xy, share.x), share.y);
}

// How far a bin can hold some of the surface at a pixel, whose CoC changes by less than a pixel a pixel. In front, what is
// nearer is blurred more, and so reaches farther.
fn kinship(k: u32, coc_px: f32) -> f32 {
    let scale = 1.0 / (abs(coc_px) + 1.0);
    let step = max((bins[k].front.x - coc_px) * scale, (coc_px - bins[k].behind.x) * scale - clamp(-coc_px, 0.0, 0.5));
    return clamp(2.0 - 2.0 * step, 0.0, 1.0);
}

// Away from all silhouettes a pixel sees one surface alone, which is opaque: the bins that it goes through fill the pixel
// among themselves.
fn layers(pixel: vec2<u32>) -> vec3<f32> {
    let coc_px = scene_unpacked(scene[pixel.y * frame.size.x + pixel.x], frame.most_px).w;
    let shows = shown[tile_of(pixel, frame.size.x, vec2(TILE))];
    let is_alone = countOneBits(shows) == 1u;
    var own = Stack(vec3(0.0), 1.0, vec3(0.0), 0.0);
    for (var rest = shows; rest != 0u; rest &= rest - 1u) {
        let k = firstTrailingBit(rest);
        own = add(own, sample_bin(k, pixel) * select(kinship(k, coc_px), 1.0, is_alone));
    }
    let covered = 1.0 - own.open;
    let is_thin = covered <= OWN_COVERAGE;
    // Near silhouettes others show, too, faded out where the aperture sees no farther.
    let reach_px = max(-coc_px, 0.0) + MARGIN_PX;
    let shares = clamp(reaching(pixel) / (FADE * reach_px * reach_px), vec2(0.0), vec2(1.0));
    if shares.x <= 0.0 && !is_thin {
        return own.color / covered;
    }
    // What is not in front itself has all behind what is.
    var back = max(shares.y, step_at(bins[max(frame.near_bins, 1u) - 1u].behind, coc_px));
    if frame.near_bins == 0u || is_thin {
        back = 1.0;
    }
    return mix(own.color / max(covered, 1.0e-6), all_surfaces(pixel, shows, back), select(shares.x, 1.0, is_thin));
}

// The near bins over the others, as far as these show; else the near ones have to fill the pixel.
fn all_surfaces(pixel: vec2<u32>, shows: u32, back_shows: f32) -> vec3<f32> {
    var front = Stack(vec3(0.0), 1.0, vec3(0.0), 0.0);
    var back = front;
    for (var rest = shows; rest != 0u; rest &= rest - 1u) {
        let k = firstTrailingBit(rest);
        let layer = sample_bin(k, pixel);
        if k < frame.near_bins {
            front = add(front, layer);
        } else {
            back = add(back, layer);
        }
    }
    if front.known <= 0.0 {
        return closed(back);
    }
    // Where nothing lies behind, what lies in front is all there is; next to nothing has no colour to fill a pixel with.
    if back.known <= 1.0e-4 {
        return closed(front);
    }
    let over = front.color + front.open * closed(back);
    if front.known <= 1.0e-3 {
        return over;
    }
    return mix(closed(front), over, back_shows);
}
