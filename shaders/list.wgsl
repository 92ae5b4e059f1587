// Shared by the passes that do listed tiles of bins. A list has the number of tiles of each bin, then a flag for each tile
// that there is, 1 if it is listed, and then the listed tiles of each bin, as many places as there are flags.

const HEAD = 16u;

fn places_at(length: u32) -> u32 {
    return HEAD + (length - HEAD) / 2u;
}
