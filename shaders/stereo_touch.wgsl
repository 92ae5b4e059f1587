// Included by the passes that find islands: whether two neighbours belong to one.

fn is_connected(a: u32, b: u32) -> bool {
    return a != UNKNOWN && b != UNKNOWN && difference(a, b) <= STEP;
}
