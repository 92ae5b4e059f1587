// Shared by the passes that compare entries with the surfaces around them. Such a pass has `entries` and `colors`.

// Shares are tried in steps of an eighth.
const STEPS = 8u;

// What the colour of an entry says of it, whose answer was found.
fn compare(k: u32, labels: u32) {
    let at = entries[k].at;
    let near = colors[2u * entries[k].answer];
    let far = colors[2u * entries[k].answer + 1u];
    let own = light_at(at);
    let spread = spread_of(near, far);
    var before = far.mean;
    // What is remembered of a surface that looks otherwise here is not of that surface.
    var is_behind = is_known_behind(at, entries[k].near);
    if is_behind {
        let light = light_behind(at);
        is_behind = is_like(far, light);
        before = select(far.mean, light, is_behind);
    }
    let d = discriminant_of(near.mean, spread, before);
    let share = share_of(d, own);
    var off_line = 0.0;
    if is_behind {
        let off = own - before - clamp(share, 0.0, 1.0) * (near.mean - before);
        off_line = dot(off, times(spread, off));
    }
    let is_near = (labels & NEAR) != 0u;
    // What is no mixture of both has a colour of its own, as lone hair beside a face.
    let fits = max(exp(-min(off_line, 80.0)), LEAST_OFF_LINE);
    var low = vec2(0.0);
    var middle = vec2(0.0);
    var high = vec2(0.0);
    var pure = 0.0;
    for (var step = 0u; step <= STEPS; step++) {
        let tried = f32(step) / f32(STEPS);
        let off = tried - clamp(share, -0.3, 1.3);
        let likelihood = fits * max(exp(-min(0.5 * d.certainty * off * off, 80.0)), LEAST);
        let both = vec2(likelihood, likelihood * tried);
        low += select(vec2(0.0), both, step < STEPS / 2u);
        middle += select(vec2(0.0), both, step == STEPS / 2u);
        high += select(vec2(0.0), both, step > STEPS / 2u);
        pure = select(pure, likelihood, step == select(0u, STEPS, is_near));
    }
    // No pixel of a surface whose light is known is like none of it.
    let outlier = select(OUTLIER, 0.0, is_behind && !is_near);
    let every = (low + middle + high) / f32(STEPS + 1u);
    let sided = (select(low, high, is_near) + middle) / f32(STEPS / 2u + 1u);
    entries[k].clean = max(pure, outlier / sqrt(d.certainty));
    entries[k].sided = select(sided, every, (labels & THIN) != 0u);
    entries[k].every = every;
    atomicOr(&entries[k].flags, select(0u, BEHIND, is_behind));
}
