// Included by passes that compute alpha of evaluated entries. They bind `entries`.

// Prior weights of a pure pixel, of a soft outline where the map has it, and of any alpha, for the prior (mixed,
// wrong).
fn weights_of(prior: vec2<f32>) -> vec3<f32> {
    return vec3(max(1.0 - prior.x - prior.y, 0.0), prior.x, prior.y);
}

// Posterior mean of alpha.
fn alpha_at(k: u32, prior: vec2<f32>, labels: u32) -> f32 {
    let weights = weights_of(prior);
    let pure = weights.x * entries[k].clean;
    let total = pure + weights.y * entries[k].sided.x + weights.z * entries[k].every.x;
    let is_near = f32(labels & NEAR);
    let near = pure * is_near + weights.y * entries[k].sided.y + weights.z * entries[k].every.y;
    return select(is_near, near / max(total, TINY), total > TINY);
}
