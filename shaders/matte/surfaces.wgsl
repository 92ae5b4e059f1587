// Included by passes that fit colour models. They bind `clusters`, and `colors`, two a model.
// twin: src/depth/matting/clusters/color_models.rs

// Sums of clusters, in the layout of `clusters`.
struct Sums {
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec2<f32>,
}

fn color_from_sums(s: Sums) -> Color {
    let mean = s.a.yzw / s.a.x;
    return Color(mean, s.b.xyz / s.a.x - mean.x * mean, vec3(s.b.w, s.c) / s.a.x - mean.yyz * mean.yzz);
}

// A colour that was found with this total weight: with little, it may be another one.
fn with_uncertainty(color: Color, weight: f32) -> Color {
    let variance = UNCERTAINTY * (UNCERTAIN_WEIGHT / (UNCERTAIN_WEIGHT + weight));
    return Color(color.mean, color.row + vec3(variance, 0.0, 0.0), color.rest + vec3(variance, 0.0, variance));
}

fn add_cluster(s: Sums, weight: f32, k: u32) -> Sums {
    return Sums(s.a + weight * clusters[k], s.b + weight * clusters[k + 1u], s.c + weight * clusters[k + 2u].xy);
}

// If the near surface looks different at edges, such as hair beside a face, its fringe replaces its colour in part.
fn blend_fringe(near: Color, far: Color, sums: Sums) -> Color {
    let counts = clamp((sums.a.x - FRINGE_FEW) / (FRINGE_ENOUGH - FRINGE_FEW), 0.0, 1.0);
    if counts <= 0.0 {
        return near;
    }
    let fringe = color_from_sums(sums);
    let alpha = discriminant_alpha(near, far, fringe.mean);
    let other = counts * clamp((FRINGE_SAME - alpha) / (FRINGE_SAME - FRINGE_OTHER), 0.0, 1.0);
    if other <= 0.0 {
        return near;
    }
    let own = clamp(far.mean + (fringe.mean - far.mean) / FRINGE_ALPHA, vec3(0.0), vec3(1.0));
    return Color(mix(near.mean, own, other), mix(near.row, fringe.row, other), mix(near.rest, fringe.rest, other));
}

// Computes the colours of both surfaces around a cell, for a model with these inverse depths. Returns whether both have
// pixels.
fn find_colors(cell: vec2<u32>, near: f32, far: f32, model: u32) -> bool {
    // A surface's inverse depth may vary around, but not as far as to the other surface.
    let tolerance = max(2.0 * frame.depth_step, 0.25 * (near - far));
    let across = cells_across();
    let last = vec2(across, (frame.size.y + CELL - 1u) / CELL) - 1u;
    let middle = vec2<f32>(cell * CELL) + 0.5 * f32(CELL - 1u);
    for (var attempt = 0u; attempt < 3u; attempt++) {
        let radius = select(select(RADIUS_FARTHEST, RADIUS_FURTHER, attempt == 1u), RADIUS, attempt == 0u);
        let from_cell = cell - min(cell, vec2(radius));
        let to_cell = min(cell + radius, last);
        var of_near = Sums();
        var of_far = Sums();
        var of_fringe = Sums();
        for (var row = from_cell.y; row <= to_cell.y; row++) {
            for (var k = 12u * (row * across + from_cell.x); k < 12u * (row * across + to_cell.x + 1u); k += 4u) {
                let inverse = clusters[k + 3u].x;
                let is_near = inverse > 0.5 * (near + far);
                let is_fringe = k % 12u == 8u;
                if clusters[k].x <= 0.0 || abs(inverse - select(far, near, is_near)) > tolerance || (is_fringe && !is_near) {
                    continue;
                }
                let off = clusters[k + 2u].zw - middle;
                let falloff = 1.0 / (1.0 + dot(off, off) / (FALLOFF_PX * FALLOFF_PX));
                let weight = falloff * falloff * falloff;
                if is_fringe {
                    of_fringe = add_cluster(of_fringe, weight, k);
                } else if is_near {
                    of_near = add_cluster(of_near, weight, k);
                } else {
                    of_far = add_cluster(of_far, weight, k);
                }
            }
        }
        if of_near.a.x > 0.0 && of_far.a.x > 0.0 {
            let color = color_from_sums(of_far);
            colors[2u * model] = blend_fringe(with_uncertainty(color_from_sums(of_near), of_near.a.x), color, of_fringe);
            colors[2u * model + 1u] = color;
            return true;
        }
    }
    return false;
}
