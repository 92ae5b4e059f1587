// Shared by the passes that run several times.

struct Turn {
    at: u32,        // which time it is
}
