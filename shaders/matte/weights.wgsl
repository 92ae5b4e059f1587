// Included by passes that compute alpha of evaluated entries. They bind `entries`.

// Prior weights of a pure pixel, of a soft outline where the map has it, and of any alpha, for the prior (mixed,
// wrong).
fn mixture_weights(prior: vec2<f32>) -> vec3<f32> {
    return vec3(max(1.0 - prior.x - prior.y, 0.0), prior.x, prior.y);
}

// Posterior mean of alpha.
fn posterior_alpha(k: u32, prior: vec2<f32>, labels: u32) -> f32 {
    let weights = mixture_weights(prior);
    let pure = weights.x * entries[k].pure;
    let total = pure + weights.y * entries[k].sided.x + weights.z * entries[k].any_alpha.x;
    let is_near = f32(labels & NEAR);
    let near = pure * is_near + weights.y * entries[k].sided.y + weights.z * entries[k].any_alpha.y;
    return select(is_near, near / max(total, TINY), total > TINY);
}
