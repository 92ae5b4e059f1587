// Included by passes that evaluate entries against their colour models. They bind `entries` and `colors`.
// twin: src/depth/matting/share.rs and passes.rs

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
fn compare(k: u32, labels: u32) {
    let at = entries[k].at;
    let near = colors[2u * entries[k].model];
    let far = colors[2u * entries[k].model + 1u];
    let own = light_at(at);
    let spread = spread_of(near, far);
    var before = far.mean;
    // A remembered colour unlike the far surface here is of another surface.
    var is_behind = is_known_behind(at, entries[k].near);
    if is_behind {
        let light = light_behind(at);
        is_behind = is_like(far, light);
        before = select(far.mean, light, is_behind);
    }
    let d = discriminant_of(near.mean, spread, before);
    let alpha = alpha_of(d, own);
    var off_line = 0.0;
    if is_behind {
        let off = own - before - clamp(alpha, 0.0, 1.0) * (near.mean - before);
        off_line = dot(off, times(spread, off));
    }
    let is_near = (labels & NEAR) != 0u;
    // A colour off the line between both surfaces is no mixture of them, such as a lone hair beside a face.
    let fits = max(exp(-min(off_line, 80.0)), MIN_OFF_LINE);
    let outline = labels / OUTLINE % 8u;
    var every = vec2(0.0);
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
        every += both;
        sided += likely * both;
        pure = select(pure, likelihood, own == STEPS);
    }
    // If the background is known, a far pixel is no outlier.
    let outlier = select(OUTLIER, 0.0, is_behind && !is_near);
    every /= f32(STEPS + 1u);
    entries[k].clean = max(pure, outlier / sqrt(d.certainty));
    entries[k].sided = select(sided, every, (labels & THIN) != 0u);
    entries[k].every = every;
    atomicOr(&entries[k].flags, select(0u, BEHIND, is_behind));
}
