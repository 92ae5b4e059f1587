// Included by the passes that find components: whether two neighbours belong to one.

fn is_connected(a: u32, b: u32) -> bool {
    return a != UNKNOWN && b != UNKNOWN && abs_diff(a, b) <= MAX_SPECKLE_STEP;
}
