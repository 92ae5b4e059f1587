// Included by passes that evaluate entries against their colour models. They bind `entries` and `colors`.
// twin: src/depth/matting/alpha.rs and passes.rs

// Alpha is sampled in steps of an eighth.
const STEPS = 8u;

// Numbers of sides and corners that belong to the entry's own surface, and for each the prior probability of the own
// surface's coverage, from one half to 1.
const OUTLINES = array(vec2(2u, 2u), vec2(2u, 3u), vec2(3u, 2u), vec2(3u, 3u), vec2(4u, 3u));
const ALPHA_PRIORS = array(
    array(0.2, 0.2, 0.2, 0.2, 0.2),
    array(0.227, 0.358, 0.254, 0.133, 0.029),
    array(0.058, 0.095, 0.177, 0.365, 0.305),
    array(0.029, 0.083, 0.137, 0.218, 0.533),
    array(0.140, 0.140, 0.140, 0.146, 0.434),
    array(0.100, 0.100, 0.100, 0.100, 0.600),
    array(0.060, 0.060, 0.060, 0.060, 0.760),
);

// Computes the likelihoods of an entry's colour, whose model has both surfaces.
fn evaluate_color(k: u32, labels: u32) {
    let at = entries[k].at;
    let near = colors[2u * entries[k].model];
    let far = colors[2u * entries[k].model + 1u];
    let own = light_at(at);
    let spread = inverse_scatter(near, far);
    var before = far.mean;
    // A remembered colour unlike the far surface here is of another surface.
    var has_background = is_background_known(at, entries[k].near);
    if has_background {
        let light = background_light(at);
        has_background = is_plausible_far(far, light);
        before = select(far.mean, light, has_background);
    }
    let d = create_discriminant(near.mean, spread, before);
    let alpha = discriminant_alpha(d, own);
    var off_line = 0.0;
    if has_background {
        let off = own - before - clamp(alpha, 0.0, 1.0) * (near.mean - before);
        off_line = dot(off, multiply(spread, off));
    }
    let is_near = (labels & NEAR) != 0u;
    // A colour off the line between both surfaces is no mixture of them, such as a lone hair beside a face.
    let fits = max(exp(-min(off_line, 80.0)), MIN_OFF_LINE);
    let outline = labels / OUTLINE % 8u;
    var any_alpha = vec2(0.0);
    var sided = vec2(0.0);
    var pure = 0.0;
    for (var step = 0u; step <= STEPS; step++) {
        let tried = f32(step) / f32(STEPS);
        let off = tried - clamp(alpha, -0.3, 1.3);
        let likelihood = fits * max(exp(-min(0.5 * d.certainty * off * off, 80.0)), MIN_LIKELIHOOD);
        let both = vec2(likelihood, likelihood * tried);
        // Coverage by its own surface; below one half, it is not on the map's side.
        let own = select(STEPS - step, step, is_near);
        let likely = select(0.0, ALPHA_PRIORS[outline][max(own, STEPS / 2u) - STEPS / 2u], own >= STEPS / 2u);
        any_alpha += both;
        sided += likely * both;
        pure = select(pure, likelihood, own == STEPS);
    }
    // If the background is known, a far pixel is no outlier.
    let outlier = select(OUTLIER, 0.0, has_background && !is_near);
    any_alpha /= f32(STEPS + 1u);
    entries[k].pure = max(pure, outlier / sqrt(d.certainty));
    entries[k].sided = select(sided, any_alpha, (labels & THIN) != 0u);
    entries[k].any_alpha = any_alpha;
    atomicOr(&entries[k].flags, select(0u, KNOWN_BACKGROUND, has_background));
}
