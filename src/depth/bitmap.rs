//! A bitmap with one bit per pixel.

/// Bits per word.
pub const WORD: usize = 64;

/// A bitmap, row by row, in 64-bit words.
#[derive(Debug, Default)]
pub struct Bitmap {
    words: Vec<u64>,
    /// Words per row: one more than needed, so that reading a word and its successor never leaves the buffer.
    across: usize,
}

impl Bitmap {
    /// Resizes to `(width, height)` pixels. Bits keep their values if the size is unchanged, and are unspecified
    /// otherwise.
    pub fn resize(&mut self, (width, height): (usize, usize)) {
        self.across = width.div_ceil(WORD) + 1;
        self.words.resize(self.across * height, 0);
    }

    /// Resizes to `(width, height)` pixels and clears all bits.
    pub fn clear(&mut self, size: (usize, usize)) {
        self.words.clear();
        self.resize(size);
    }

    /// Returns all words, row by row, and the number of words per row.
    pub fn words(&mut self) -> (&mut [u64], usize) {
        (&mut self.words, self.across)
    }

    /// Returns the [`WORD`] bits that start at pixel (`x`, `y`), which is the lowest bit, and continue to the right.
    #[inline(always)]
    pub fn word_at(&self, x: usize, y: usize) -> u64 {
        let (at, shift) = (y * self.across + x / WORD, x % WORD);
        self.words[at] >> shift | self.words[at + 1] << 1 << (WORD - 1 - shift)
    }

    /// Whether the bit of a pixel is set.
    #[inline(always)]
    pub fn has(&self, x: usize, y: usize) -> bool {
        self.words[y * self.across + x / WORD] >> (x % WORD) & 1 != 0
    }

    /// Sets the bit of a pixel.
    #[inline(always)]
    pub fn set(&mut self, x: usize, y: usize) {
        self.words[y * self.across + x / WORD] |= 1 << (x % WORD);
    }

    /// Clears the bit of a pixel.
    #[inline(always)]
    pub fn unset(&mut self, x: usize, y: usize) {
        self.words[y * self.across + x / WORD] &= !(1 << (x % WORD));
    }

    /// Sets the pixels that are set in `bits`, in the layout that [`Self::word_at`] returns.
    #[inline(always)]
    pub fn set_word(&mut self, x: usize, y: usize, bits: u64) {
        let (at, shift) = (y * self.across + x / WORD, x % WORD);
        self.words[at] |= bits << shift;
        self.words[at + 1] |= bits >> 1 >> (WORD - 1 - shift);
    }
}

/// Iterates over the positions of the set bits, from the lowest.
#[inline(always)]
pub fn set_bits(mut bits: u64) -> impl Iterator<Item = usize> {
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
        let (mut bits, set) = (Bitmap::default(), [0, 3, 63, 64, 129]);
        bits.clear((130, 3));
        set.iter().for_each(|&x| bits.set(x, 1));
        for x in 0..130 {
            assert_eq!((bits.has(x, 0), bits.has(x, 1), bits.has(x, 2)), (false, set.contains(&x), false));
            let seen: Vec<_> = set_bits(bits.word_at(x, 1)).map(|place| x + place).collect();
            let there: Vec<_> = set.into_iter().filter(|&at| (x..x + WORD).contains(&at)).collect();
            assert_eq!(seen, there);
        }
    }
}
