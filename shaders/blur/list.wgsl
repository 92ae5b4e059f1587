// Shared by passes over listed tiles of bins. Layout of a list: the number of listed tiles per bin, a flag per tile (1
// if listed), then the listed tiles of each bin, with one place per flag.

const HEAD = 16u;

fn listed_offset(length: u32) -> u32 {
    return HEAD + (length - HEAD) / 2u;
}
