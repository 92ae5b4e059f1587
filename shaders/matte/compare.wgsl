// Included by passes that evaluate entries against their colour models. They bind `entries` and `colors`.
// twin: src/depth/matting/alpha.rs, mixture.rs and passes.rs

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

// Probability of a pure pixel for each of them, relative to straight outlines.
const PURE_PRIORS = array(0.3, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0);

// Covariance of a colour with an isotropic part.
fn with_isotropy(color: Color) -> Symmetric {
    let part = ISOTROPY / 3.0 * (color.row.x + color.rest.x + color.rest.z);
    return Symmetric(color.row + vec3(part, 0.0, 0.0), color.rest + vec3(part, 0.0, part));
}

// Density at a distance from the mean, without the constant factor: a Student t distribution in three dimensions with five
// degrees of freedom. By the decomposition of its covariance into a triangular and a diagonal matrix (Cholesky).
fn density(m: Symmetric, off: vec3<f32>) -> f32 {
    let of_x = m.row.yz / m.row.x;
    let y = max(m.rest.x - of_x.x * m.row.y, MIN_VARIANCE);
    let yz = m.rest.y - of_x.y * m.row.y;
    let z_of_y = yz / y;
    let z = max(m.rest.z - of_x.y * m.row.z - z_of_y * yz, MIN_VARIANCE);
    let off_y = off.y - of_x.x * off.x;
    let off_z = off.z - of_x.y * off.x - z_of_y * off_y;
    let distance = off.x * off.x / m.row.x + off_y * off_y / y + off_z * off_z / z;
    let tail = 1.0 + distance / 5.0;
    return inverseSqrt(m.row.x * y * z) / (tail * tail * tail * tail);
}

// Computes the likelihoods of an entry's colour, whose model has both surfaces.
fn evaluate_color(k: u32, labels: u32) {
    let at = entries[k].at;
    let near = colors[2u * entries[k].model];
    let far = colors[2u * entries[k].model + 1u];
    let own_light = light_at(at);
    var before = far.mean;
    // A remembered colour unlike the far surface here is of another surface.
    var has_background = is_background_known(at, entries[k].near);
    if has_background {
        let light = background_light(at);
        has_background = is_plausible_far(far, light);
        before = select(far.mean, light, has_background);
    }
    let is_near = (labels & NEAR) != 0u;
    let difference = near.mean - before;
    let of_near = with_isotropy(near);
    let of_far = with_isotropy(far);
    // The parts of the covariance that are those of any alpha.
    let row = ALPHA_VARIANCE * difference.x * difference + vec3(NOISE, 0.0, 0.0);
    let rest = ALPHA_VARIANCE * difference.yyz * difference.yzz + vec3(NOISE, 0.0, NOISE);
    let outline = labels / OUTLINE % 8u;
    var any_alpha = vec2(0.0);
    var sided = vec2(0.0);
    var pure = 0.0;
    for (var step = 0u; step <= STEPS; step++) {
        let tried = f32(step) / f32(STEPS);
        let parts = vec2(tried * tried, (1.0 - tried) * (1.0 - tried));
        let spread = Symmetric(
            parts.x * of_near.row + parts.y * of_far.row + row,
            parts.x * of_near.rest + parts.y * of_far.rest + rest,
        );
        let likelihood = max(density(spread, own_light - before - tried * difference), MIN_LIKELIHOOD);
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
    entries[k].pure = PURE_PRIORS[outline] * max(pure, outlier);
    entries[k].sided = select(sided, any_alpha, (labels & THIN) != 0u);
    entries[k].any_alpha = any_alpha;
    atomicOr(&entries[k].flags, select(0u, KNOWN_BACKGROUND, has_background));
}
