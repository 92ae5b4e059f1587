// Included by passes that run several times.

struct PassRun {
    index: u32,     // index of the run
}
