// Pass directional, of the inpainting: continues outlines behind an occluder (after Bertalmio et al., Image Inpainting,
// 2000). Reads level 1 of the pyramid; writes the agreement of the lines through its hidden pixels behind all levels.
// twin: src/bokeh/cpu/directional.rs; see `DIRECTIONS` in src/bokeh/occlusion.rs

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read_write> pyramid: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> known: array<f32>;
@group(0) @binding(3) var<storage, read> dilated: array<vec4<f32>>;

const LINES = 8u;

struct End {
    value: vec4<f32>,
    steps: f32,         // distance in steps; 0 without an end
}

// A line through a hidden pixel: the value predicted from its ends, and its weight.
struct Line {
    value: vec4<f32>,
    weight: f32,
    steps: f32,             // its length; 0 without ends
    span_px: vec2<f32>,     // lowest and highest CoC of its ends
}

fn coc_similarity(a_px: f32, b_px: f32) -> f32 {
    let apart = (a_px - b_px) / HALF_SIMILAR_PX;
    return 1.0 / (1.0 + apart * apart);
}

fn find_end(level: Level, pixel: vec2<u32>, step: vec2<i32>) -> End {
    var at = vec2<i32>(pixel) + step;
    for (var steps = 1u; steps <= MAX_STEPS && all(at >= vec2(0)) && all(at < vec2<i32>(level.size)); steps++) {
        let index = pixel_index(level, vec2<u32>(at));
        if known[index] > 0.0 {
            return End(pyramid[index] / max(known[index], 1.0e-6), f32(steps));
        }
        at += step;
    }
    return End(vec4(0.0), 0.0);
}

fn evaluate_line(level: Level, pixel: vec2<u32>, direction: u32) -> Line {
    let step = vec2<i32>((vec2(STEPS_ACROSS, STEPS_DOWN) >> vec2(4u * direction)) & vec2(15u)) - 8;
    let a = find_end(level, pixel, -step);
    let b = find_end(level, pixel, step);
    let length = sqrt(f32(step.x * step.x + step.y * step.y));
    let sum = a.steps + b.steps;
    if sum == 0.0 {
        return Line(vec4(0.0), 0.0, 0.0, vec2(1.0e30, -1.0e30));
    }
    if a.steps == 0.0 || b.steps == 0.0 {
        let value = select(a.value, b.value, a.steps == 0.0);
        return Line(value, 1.0 / (ONE_ENDED_FACTOR * length * sum), ONE_ENDED_FACTOR * length * sum, vec2(value.w));
    }
    let similarity = coc_similarity(a.value.w, b.value.w);
    let span_px = vec2(min(a.value.w, b.value.w), max(a.value.w, b.value.w));
    return Line(mix(a.value, b.value, a.steps / sum), similarity * similarity / (length * sum), length * sum, span_px);
}

@compute @workgroup_size(SMALL_TILE, SMALL_TILE)
fn directional(@builtin(global_invocation_id) id: vec3<u32>) {
    let level = pyramid_level(1u);
    if any(id.xy >= level.size) {
        return;
    }
    let index = pixel_index(level, id.xy);
    let found = directional_offset() + index;
    known[found] = 0.0;
    // Pixels of level 1 are the cells of the silhouettes' grid.
    if known[index] > 0.0 || dilated[id.y * level.size.x + id.x].x <= 0.0 {
        return;
    }
    var lines: array<Line, LINES>;
    var span_px = vec2(1.0e30, -1.0e30);
    var shortest = 1.0e30;
    for (var d = 0u; d < LINES; d++) {
        lines[d] = evaluate_line(level, id.xy, d);
        shortest = min(shortest, select(1.0e30, lines[d].steps, lines[d].steps > 0.0));
        span_px = vec2(min(span_px.x, lines[d].span_px.x), max(span_px.y, lines[d].span_px.y));
    }
    // For a single surface, pull-push averaging is as good.
    if span_px.y - span_px.x < ONE_SURFACE_PX {
        return;
    }
    // Agreement of a line with the others counts to the fourth power: a mean of two surfaces would be neither.
    var scores: array<f32, LINES>;
    var best = 1.0e-30;
    for (var d = 0u; d < LINES; d++) {
        var score = 0.0;
        for (var e = 0u; e < LINES; e++) {
            score += lines[e].weight * coc_similarity(lines[d].value.w, lines[e].value.w);
        }
        scores[d] = score;
        best = max(best, score);
    }
    var sum = Known(vec4(0.0), 0.0);
    for (var d = 0u; d < LINES; d++) {
        let agreed = scores[d] * scores[d] / (best * best);
        sum = plus(sum, times(Known(lines[d].value, 1.0), lines[d].weight * agreed * agreed));
    }
    if sum.known > 0.0 {
        let trust = clamp(2.0 - shortest / TRUSTED_STEPS, 0.0, 1.0);
        pyramid[found] = trust * sum.value / sum.known;
        known[found] = trust;
    }
}
