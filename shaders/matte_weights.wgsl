// Shared by the passes that tell the share of entries that were compared. Such a pass has `entries`.

// How likely an entry is pure, part of a soft outline where the map says, or anything, where mixed and wrong ones are so likely.
fn weights_of(prior: vec2<f32>) -> vec3<f32> {
    return vec3(max(1.0 - prior.x - prior.y, 0.0), prior.x, prior.y);
}

// The expected share of the near surface that an entry is.
fn share_at(k: u32, prior: vec2<f32>, labels: u32) -> f32 {
    let weights = weights_of(prior);
    let pure = weights.x * entries[k].clean;
    let total = pure + weights.y * entries[k].sided.x + weights.z * entries[k].every.x;
    let is_near = f32(labels & NEAR);
    let near = pure * is_near + weights.y * entries[k].sided.y + weights.z * entries[k].every.y;
    return select(is_near, near / max(total, TINY), total > TINY);
}
