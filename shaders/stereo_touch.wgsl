// Shared by the passes that find islands: whether two neighbours are of one.

fn touch(a: u32, b: u32) -> bool {
    return a != UNKNOWN && b != UNKNOWN && difference(a, b) <= STEP;
}
