// Included by passes that run several times.

struct Turn {
    at: u32,        // index of the run
}
