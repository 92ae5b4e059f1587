//! A bit for every pixel of a picture.

/// Bits of a word.
pub const WORD: usize = 64;

/// The bits, row by row, in words.
#[derive(Debug, Default)]
pub struct Bits {
    words: Vec<u64>,
    /// Words of a row: one more than it needs, so that there is always a next.
    across: usize,
}

impl Bits {
    /// Of a picture of so many columns and rows, as they were where that is as large as before.
    pub fn resize(&mut self, (width, height): (usize, usize)) {
        self.across = width.div_ceil(WORD) + 1;
        self.words.resize(self.across * height, 0);
    }

    /// Of a picture of so many columns and rows, none set.
    pub fn clear(&mut self, size: (usize, usize)) {
        self.words.clear();
        self.resize(size);
    }

    /// All words, row by row, and how many a row has.
    pub fn words(&mut self) -> (&mut [u64], usize) {
        (&mut self.words, self.across)
    }

    /// Those of pixel (`x`, `y`), the lowest, and of all to the right of it in its row that the word has place for.
    #[inline(always)]
    pub fn from(&self, x: usize, y: usize) -> u64 {
        let (at, shift) = (y * self.across + x / WORD, x % WORD);
        self.words[at] >> shift | self.words[at + 1] << 1 << (WORD - 1 - shift)
    }

    /// Whether that of a pixel is set.
    #[inline(always)]
    pub fn has(&self, x: usize, y: usize) -> bool {
        self.words[y * self.across + x / WORD] >> (x % WORD) & 1 != 0
    }

    /// Sets that of a pixel.
    #[inline(always)]
    pub fn set(&mut self, x: usize, y: usize) {
        self.words[y * self.across + x / WORD] |= 1 << (x % WORD);
    }

    /// Sets those that are set in `bits`, as [`Self::from`] gives them.
    #[inline(always)]
    pub fn set_from(&mut self, x: usize, y: usize, bits: u64) {
        let (at, shift) = (y * self.across + x / WORD, x % WORD);
        self.words[at] |= bits << shift;
        self.words[at + 1] |= bits >> 1 >> (WORD - 1 - shift);
    }
}

/// The places of the bits that are set, from the lowest on.
#[inline(always)]
pub fn places(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (place < WORD).then_some(place)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_that_are_set_are_found_from_every_place_of_their_row() {
        let (mut bits, set) = (Bits::default(), [0, 3, 63, 64, 129]);
        bits.clear((130, 3));
        set.iter().for_each(|&x| bits.set(x, 1));
        for x in 0..130 {
            assert_eq!((bits.has(x, 0), bits.has(x, 1), bits.has(x, 2)), (false, set.contains(&x), false));
            let seen: Vec<_> = places(bits.from(x, 1)).map(|place| x + place).collect();
            let there: Vec<_> = set.into_iter().filter(|&at| (x..x + WORD).contains(&at)).collect();
            assert_eq!(seen, there);
        }
    }
}
