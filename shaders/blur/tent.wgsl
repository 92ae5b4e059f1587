// Shared by passes that average the scene down to the scale of a bin with a tent filter. Such a pass binds `work`,
// `bins`, `frame`, `scene`, `inpainted`, `ranges` and `mixed`.
// twin: src/bokeh/cpu/tent.rs

// Premultiplied colour and coverage, and coverage times |CoC|.
struct Pixel {
    value: vec4<f32>,
    coc: f32,
}

// A surface times its weight in a bin.
fn weigh_surface(k: u32, surface: vec4<f32>, weight: f32) -> Pixel {
    let total = weight * select(bin_weight(bins[k].front, bins[k].behind, surface.w), 1.0, bins[k].whole == 1u);
    return Pixel(total * vec4(surface.rgb, 1.0), total * abs(surface.w));
}

fn plus(a: Pixel, b: Pixel) -> Pixel {
    return Pixel(a.value + b.value, a.coc + b.coc);
}

// A pixel of the scene as the layer sees it. Only tiles with hidden pixels were inpainted.
fn load_scene_pixel(pixel: vec2<u32>, at: u32) -> vec2<u32> {
    let nearest_px = ranges[tile_index(pixel, frame.size.x, vec2(TILE))].x;
    if linear_step(work.visible_weight, nearest_px) < 1.0 {
        return inpainted[at];
    }
    return scene[at];
}

// A pixel of the scene times its weight in a bin.
fn weigh_pixel(k: u32, pixel: vec2<u32>, weight: f32) -> Pixel {
    let at = pixel.y * frame.size.x + pixel.x;
    let value = load_scene_pixel(pixel, at);
    let surface = unpack_scene(value, frame.max_px);
    if !is_mixed(value) {
        return weigh_surface(k, surface, weight);
    }
    let place = find_mixed_index(at);
    let near = load_near_surface(place);
    // If the nearer surface is in front of the layer, the farther one is behind it.
    let before = linear_step(work.visible_weight, near.w);
    let alpha = mixed[place].alpha * before;
    let known = 1.0 - (1.0 - mixed[place].background_alpha) * before;
    let front = weigh_surface(k, near, 1.0);
    // Parts of the farther surface that are known but not visible count only in bins without the nearer one.
    let behind = known - (known + alpha - 1.0) * min(front.value.a / HIDING_WEIGHT, 1.0);
    return plus(weigh_surface(k, surface, weight * behind),
                Pixel(weight * alpha * front.value, weight * alpha * front.coc));
}

// Average over every `step`th tap of a bin pixel and axis, from `first` on.
fn average_tent(k: u32, pixel: vec2<u32>, first: vec2<u32>, step: u32) -> Pixel {
    let scale = bins[k].scale;
    if scale == 1u {
        return weigh_pixel(k, pixel, 1.0);
    }
    // A tent of twice the scale, which preserves the centroid.
    let inverse = 1.0 / f32(scale);
    var sum = Pixel(vec4(0.0), 0.0);
    for (var j = first.y; j < 2u * scale; j += step) {
        let y = u32(clamp(i32(pixel.y * scale + j) - i32(scale / 2u), 0, i32(frame.size.y) - 1));
        let weight_y = (1.0 - abs((f32(j) + 0.5) * inverse - 1.0)) * inverse;
        for (var i = first.x; i < 2u * scale; i += step) {
            let x = u32(clamp(i32(pixel.x * scale + i) - i32(scale / 2u), 0, i32(frame.size.x) - 1));
            let weight_x = (1.0 - abs((f32(i) + 0.5) * inverse - 1.0)) * inverse;
            sum = plus(sum, weigh_pixel(k, vec2(x, y), weight_x * weight_y));
        }
    }
    return sum;
}
